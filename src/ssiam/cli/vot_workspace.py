"""`ssiam vot-workspace`: make the official VOT toolkit run trackers of ours."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, get_args

from cyclopts import Parameter

from ssiam.errors import ArgumentError, check_choice
from ssiam.evaluation.trax_server import check_trax
from ssiam.evaluation.workspace import Entry, write_workspace
from ssiam.stabilize import Method
from ssiam.trackers import TRACKERS, TrackerName, load_tracker

_METHODS: tuple[Method, ...] = get_args(Method)
# The versions that work together; later ones fail on supervised experiments.
_TOOLKIT = "vot-toolkit==0.7.4 attributee==0.1.9"


def vot_workspace(
    folder: Path,
    /,
    *,
    trackers: str = "csrt",
    stabilize: str = "off,paper",
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
        Ways of steadying, separated by commas: off, paper, literal.
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
    entries = _entries(trackers.split(","), stabilize.split(","), weights or [])
    count = write_workspace(folder, entries, stack=stack, sequences=sequences, force=force)
    _tell(folder, [entry.label for entry in entries], count)


def _entries(trackers: list[str], methods: list[str], weights: list[str]) -> list[Entry]:
    paths = dict(_weights(text) for text in weights)
    for given in paths.keys() - set(trackers):
        raise ArgumentError(f"--weights {given}={paths[given]}: {given} is not in --trackers")
    entries = []
    for text in trackers:
        name: TrackerName = check_choice("tracker", text, TRACKERS)
        load_tracker(name, weights=paths.get(name))
        for way in methods:
            method: Method = check_choice("stabilize", way, _METHODS)
            entries.append(Entry(name, method, paths.get(name)))
    return entries


def _weights(text: str) -> tuple[str, Path]:
    name, equals, path = text.partition("=")
    if not (name and equals and path):
        raise ArgumentError(
            f"--weights {text!r} names no tracker: give NAME=PATH, such as "
            "nanotrack_v2=weights/nanotrackv2"
        )
    return name, Path(path)


def _tell(folder: Path, labels: Sequence[str], sequences: int) -> None:
    """Print what to type next."""
    count = str(sequences) if sequences else "to be fetched by the toolkit"
    print(f"{folder}: trackers: {len(labels)}, sequences: {count}")
    print(f"next, in an environment of its own with {_TOOLKIT}:")
    print(f"  cd {shlex.quote(str(folder))}")
    print(f"  vot evaluate {' '.join(labels)}")
    print(f"  vot analysis --name all {' '.join(labels)}")
    print(f"  vot report --name all {' '.join(labels)}")
