"""`ssiam vot-workspace`: configure the official VOT toolkit to run trackers of ssiam."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ssiam.cli.options import parse_weights, split_words
from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation.runs.entries import Entry, entries
from ssiam.evaluation.vot.trax import check_trax
from ssiam.evaluation.vot.workspace import left_out, write_workspace
from ssiam.stabilize import METHODS

# Versions that work together; later ones fail on supervised experiments.
_TOOLKIT = "vot-toolkit==0.7.4 attributee==0.1.9"


def vot_workspace(
    folder: Path,
    /,
    *,
    trackers: str = "csrt",
    stabilize: str = "off,paper,predict",
    weights: Annotated[list[str] | None, Parameter(negative=())] = None,
    stack: str | None = None,
    sequences: Path | None = None,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Write a workspace in which the official VOT toolkit runs trackers of ssiam.

    There is one entry per tracker and stabilization method, run with this Python interpreter.

    Parameters
    ----------
    folder
        The workspace; created if it does not exist.
    trackers
        Comma-separated names of trackers.
    stabilize
        Comma-separated stabilization methods: off, paper, literal, predict.
    weights
        NAME=PATH: a tracker and the file or folder of its weights. Repeat for further trackers.
    stack
        Experiments to run: a stack of the toolkit, such as vot2018/shortterm, or a stack file. By
        default one supervised experiment with an EAO interval that fits the sequences.
    sequences
        Folder of sequences in VOT's layout; they are listed in the workspace, not copied. By
        default FOLDER/sequences; if it does not exist, the toolkit downloads those of its stack.
    force
        Replace existing files.
    """
    check_trax()
    competitors = _entries(split_words(trackers), split_words(stabilize), weights or [])
    omitted = left_out(folder, sequences)
    count = write_workspace(folder, competitors, stack=stack, sequences=sequences, force=force)
    for line in omitted:
        print(line)
    _print_next_steps(folder, [entry.label for entry in competitors], count)


def _entries(trackers: list[str], methods: list[str], pairs: list[str]) -> list[Entry]:
    """The entries, after loading each one as a check."""
    weights = parse_weights(pairs)
    for name in weights.keys() - set(trackers):
        raise ArgumentError(f"--weights {name}={weights[name]}: {name} is not in --trackers")
    chosen = [check_choice("stabilize", word, METHODS) for word in methods]
    competitors = entries(trackers, chosen, weights)
    for entry in competitors:
        entry.load()
    return competitors


def _print_next_steps(folder: Path, labels: Sequence[str], sequences: int) -> None:
    """Print the next commands."""
    count = str(sequences) if sequences else "to be downloaded by the toolkit"
    print(f"{folder}: trackers: {len(labels)}, sequences: {count}")
    print(f"next, in a separate environment with {_TOOLKIT}:")
    print(f"  cd {shlex.quote(str(folder))}")
    print(f"  vot evaluate {' '.join(labels)}")
    print(f"  vot analysis --name all {' '.join(labels)}")
    print(f"  vot report --name all {' '.join(labels)}")
