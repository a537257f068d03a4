"""A workspace of the official VOT toolkit: its configuration, with trackers of ours in it."""

from __future__ import annotations

import configparser
import io
import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from ssiam.errors import SinkError
from ssiam.evaluation.entries import Entry
from ssiam.evaluation.workspace_sequences import LIST, length_of, sequence_folders
from ssiam.evaluation.workspace_stack import is_official, read_stack, supervised_stack
from ssiam.outputs import atomic_write, check_distinct, make_folder

_SEQUENCES = "sequences"
_STACK = "stack.yaml"
_TRACKERS = "trackers.ini"
_TIMEOUT = 60  # seconds a frame, after which the toolkit gives a tracker up

_CONFIG = """\
registry:
- ./{trackers}
stack: {stack}
sequences: {sequences}
"""


def write_workspace(
    folder: Path,
    entries: Sequence[Entry],
    *,
    stack: str | None = None,
    sequences: Path | None = None,
    force: bool = False,
) -> int:
    """Make `folder` a workspace.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    entries : sequence of Entry
    stack : str, optional
        One of the toolkit's stacks ("vot2018/shortterm") or a file of another; without it, one
        supervised run whose EAO interval fits the sequences.
    sequences : Path, optional
        Folder of sequences in VOT's layout, which stay where they are; without it, those in the
        workspace's own folder ``sequences``.
    force : bool
        Replace files that are there already.

    Returns
    -------
    int
        Number of sequences; 0 if there are none yet, and the toolkit is to fetch those of its
        stack.

    Raises
    ------
    ArgumentError
        The stack is neither a file nor one of the toolkit's, or the workspace would replace the
        stack's file, the sequences' list.txt or weights.
    DatasetError
        There are no sequences, or one of them is damaged.
    SinkError
        A file is there already, or cannot be written.
    """
    official = stack is not None and is_official(stack)
    own = folder / _SEQUENCES
    fetched = official and sequences is None and not own.is_dir()
    found = [] if fetched else sequence_folders(own if sequences is None else sequences)
    files = {folder / "config.yaml": _config(stack if official else None)}
    files[folder / _TRACKERS] = _trackers(entries)
    if stack is None:
        files[folder / _STACK] = supervised_stack([length_of(path) for path in found])
    elif not official:
        files[folder / _STACK] = read_stack(Path(stack))
    if sequences is not None:
        files[own / LIST] = "".join(f"{path.absolute()}\n" for path in found)
    elif found and not (own / LIST).is_file():
        files[own / LIST] = "".join(f"{path.name}\n" for path in found)
    inputs = [] if stack is None or official else [("the stack", Path(stack))]
    inputs += [] if sequences is None else [("the sequences' list", sequences / LIST)]
    inputs += [("the weights", entry.weights) for entry in entries if entry.weights is not None]
    check_distinct([("the workspace's", path) for path in files], inputs)
    _write(files, force)
    return len(found)


def _config(stack: str | None) -> str:
    name = f"./{_STACK}" if stack is None else stack
    return _CONFIG.format(trackers=_TRACKERS, stack=json.dumps(name), sequences=_SEQUENCES)


def _trackers(entries: Sequence[Entry]) -> str:
    registry = configparser.ConfigParser()
    for entry in entries:
        registry[entry.label] = {
            "label": entry.label,
            "protocol": "trax",
            "command": _command(entry).replace("%", "%%"),
            "timeout": str(_TIMEOUT),
        }
    text = io.StringIO()
    registry.write(text)
    return text.getvalue()


def _command(entry: Entry) -> str:
    """Starts the tracker's TraX server with this interpreter, from any folder."""
    words = [sys.executable, "-m", "ssiam", "trax", "--tracker", entry.tracker]
    words += ["--stabilize", entry.config.stabilize]
    if entry.weights is not None:
        words += ["--weights", str(entry.weights.absolute())]
    return shlex.join(words)


def _write(files: Mapping[Path, str], force: bool) -> None:
    """Write all of them, or none if one is there already."""
    for path in files:
        if path.exists() and not force:
            raise SinkError(f"{path} exists already: give --force to replace it")
    for path, text in files.items():
        make_folder(path.parent)
        with atomic_write(path, "w", hidden=True) as file:
            file.write(text)
