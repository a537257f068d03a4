"""`ssiam vot-workspace`: make the official VOT toolkit run trackers of ours."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ssiam.cli.arguments import weights_by_tracker, words
from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation.runs.entries import Entry, entries
from ssiam.evaluation.vot.trax import check_trax
from ssiam.evaluation.vot.workspace import write_workspace
from ssiam.stabilize import METHODS

# The versions that work together; later ones fail on supervised experiments.
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
    """Write a workspace in which the official VOT toolkit runs trackers of ours.

    Each tracker is entered once for each way of steadying, and is run with this interpreter.

    Parameters
    ----------
    folder
        The workspace; made if it is not there.
    trackers
        Trackers, separated by commas.
    stabilize
        Ways of steadying, separated by commas: off, paper, literal, predict.
    weights
        NAME=PATH, the networks of a tracker that has any; give it again for each of them.
    stack
        Experiments to run: a stack of the toolkit, such as vot2018/shortterm, or a file of
        another; without it, one supervised run whose EAO interval fits the sequences.
    sequences
        Folder of sequences in VOT's layout, which stay where they are; without it, those in
        FOLDER/sequences, or the toolkit fetches those of its stack.
    force
        Replace files that are there already.
    """
    check_trax()
    competitors = _entries(words(trackers), words(stabilize), weights or [])
    count = write_workspace(folder, competitors, stack=stack, sequences=sequences, force=force)
    _tell(folder, [entry.label for entry in competitors], count)


def _entries(trackers: list[str], methods: list[str], pairs: list[str]) -> list[Entry]:
    """The competitors, each of which could be loaded."""
    weights = weights_by_tracker(pairs)
    for given in weights.keys() - set(trackers):
        raise ArgumentError(f"--weights {given}={weights[given]}: {given} is not in --trackers")
    chosen = [check_choice("stabilize", word, METHODS) for word in methods]
    competitors = entries(trackers, chosen, weights)
    for entry in competitors:
        entry.load(threads=1)
    return competitors


def _tell(folder: Path, labels: Sequence[str], sequences: int) -> None:
    """Print what to type next."""
    count = str(sequences) if sequences else "to be fetched by the toolkit"
    print(f"{folder}: trackers: {len(labels)}, sequences: {count}")
    print(f"next, in an environment of its own with {_TOOLKIT}:")
    print(f"  cd {shlex.quote(str(folder))}")
    print(f"  vot evaluate {' '.join(labels)}")
    print(f"  vot analysis --name all {' '.join(labels)}")
    print(f"  vot report --name all {' '.join(labels)}")
