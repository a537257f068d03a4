"""Workspaces of the official VOT toolkit: configuration, tracker registry, stack, sequence list."""

from __future__ import annotations

import configparser
import io
import json
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from ssiam.datasets.files import read_text
from ssiam.datasets.vot import read_vot
from ssiam.errors import ArgumentError, DatasetError, SinkError, one_line
from ssiam.evaluation.measures.eao import Interval
from ssiam.evaluation.runs.entries import Entry
from ssiam.outputs import atomic_write, check_distinct, make_folder

_SEQUENCES = "sequences"
_STACK = "stack.yaml"
_TRACKERS = "trackers.ini"
_TIMEOUT = 60  # seconds per frame, after which the toolkit aborts a tracker
_CONFIG = """\
registry:
- ./{trackers}
stack: {stack}
sequences: {sequences}
"""
_LIST = "list.txt"
_TRUTH = "groundtruth.txt"
# Ends of the EAO interval as shares of the shortest sequence. If no fragment reaches the lower end
# the toolkit gives nan; if none reaches the upper end it silently shortens the interval.
_LOW, _HIGH = 2 / 9, 2 / 3
_OFFICIAL = re.compile(r"[a-z0-9]+(/[a-z0-9]+)?")
_SUPERVISED = """\
title: Supervised runs
experiments:
  baseline:
    type: supervised
    repetitions: 1
    skip_initialize: 5
    analyses:
      - type: supervised_average_ar
        sensitivity: 30
      - type: supervised_eao_score
        low: {low}
        high: {high}
      - type: supervised_eao_curve
"""


def write_workspace(
    folder: Path,
    entries: Sequence[Entry],
    *,
    stack: str | None = None,
    sequences: Path | None = None,
    force: bool = False,
) -> int:
    """Write the files of a workspace into `folder`.

    Parameters
    ----------
    folder : Path
        Created if it does not exist.
    entries : sequence of Entry
    stack : str, optional
        One of the toolkit's stacks ("vot2018/shortterm") or the file of another. Defaults to one
        supervised run whose EAO interval fits the sequences.
    sequences : Path, optional
        Folder of sequences in VOT's layout, which are not copied. Defaults to the folder
        ``sequences`` of the workspace.
    force : bool
        Replace existing files.

    Returns
    -------
    int
        Number of sequences; 0 if the toolkit has yet to download those of its stack.

    Raises
    ------
    ArgumentError
        The stack is neither a file nor one of the toolkit's, or the workspace would replace the
        stack's file, the sequences' list.txt or weights.
    DatasetError
        There are no sequences, or one of them is damaged.
    SinkError
        A file exists already, or cannot be written.
    """
    is_official = stack is not None and _is_official(stack)
    inside = folder / _SEQUENCES
    is_downloaded = is_official and sequences is None and not inside.is_dir()
    found = [] if is_downloaded else _sequence_folders(sequences or inside)
    files = {folder / "config.yaml": _config(stack if is_official else None)}
    files[folder / _TRACKERS] = _trackers(entries)
    if stack is None:
        files[folder / _STACK] = _supervised_stack([_length_of(path) for path in found])
    elif not is_official:
        files[folder / _STACK] = _read_stack(Path(stack))
    if sequences is not None:
        files[inside / _LIST] = "".join(f"{path.absolute()}\n" for path in found)
    elif found and not (inside / _LIST).is_file():
        files[inside / _LIST] = "".join(f"{path.name}\n" for path in found)
    inputs = [] if stack is None or is_official else [("the stack", Path(stack))]
    inputs += [] if sequences is None else [("the sequences' list", sequences / _LIST)]
    inputs += [("the weights", entry.weights) for entry in entries if entry.weights is not None]
    check_distinct([("the workspace's", path) for path in files], inputs)
    _write(files, force)
    return len(found)


def left_out(folder: Path, sequences: Path | None = None) -> list[str]:
    """A line for each folder beside the sequences of a workspace that is not one of them.

    Parameters
    ----------
    folder : Path
        The workspace.
    sequences : Path, optional
        As for `write_workspace`.
    """
    source = folder / _SEQUENCES if sequences is None else sequences
    if not source.is_dir():
        return []
    listed = source / _LIST
    chosen = {path.resolve() for path in _sequence_folders(source)}
    others = [
        path
        for path in sorted(source.iterdir())
        if path.is_dir() and path.resolve() not in chosen and not path.name.startswith(".")
    ]
    if listed.is_file():
        return [f"{path.name}: left out, not in {listed}" for path in others]
    return [f"{path.name}: left out, {_reason_against(path)}" for path in others]


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
    """The command that starts the tracker's TraX server with this interpreter, from any folder."""
    words = [sys.executable, "-m", "ssiam", "trax", "--tracker", entry.tracker]
    words += ["--stabilize", entry.config.stabilize]
    if entry.weights is not None:
        words += ["--weights", str(entry.weights.absolute())]
    return shlex.join(words)


def _write(files: Mapping[Path, str], force: bool) -> None:
    """Write all files, or none if one exists and must not be replaced."""
    for path in files:
        if path.exists() and not force:
            raise SinkError(f"{path} exists already: give --force to replace it")
    for path, text in files.items():
        make_folder(path.parent)
        with atomic_write(path, "w", hidden=True) as file:
            file.write(text)


def _sequence_folders(source: Path) -> list[Path]:
    """The sequences in a folder: those of its list.txt, or all subfolders that can be read.

    Raises
    ------
    DatasetError
        There are none, or one of the list has no groundtruth.txt or is damaged.
    """
    listed = source / _LIST
    if listed.is_file():
        names = [name.strip() for name in read_text(listed).splitlines()]
        folders = [_listed_folder(source, name) for name in names if name]
    elif source.is_dir():
        candidates = sorted(path.parent for path in source.glob(f"*/{_TRUTH}"))
        folders = [path for path in candidates if not _reason_against(path)]
        if candidates and not folders:
            raise DatasetError(_reason_against(candidates[0]))
    else:
        raise DatasetError(f"{source}: is not a folder; give the folder of the sequences")
    for folder in folders:
        if not (folder / _TRUTH).is_file():
            raise DatasetError(
                f"{folder}: has no {_TRUTH}; add it, or remove the folder from {listed}"
            )
        if reason := _reason_against(folder):
            raise DatasetError(reason)
    if not folders:
        raise DatasetError(
            f"{source}: contains no VOT sequence, which is a folder with a {_TRUTH} and images"
        )
    return folders


def _listed_folder(source: Path, name: str) -> Path:
    """The folder that a line of list.txt names; `DatasetError` if no folder can have this name."""
    folder = source / name
    try:
        folder.stat()
    except FileNotFoundError:  # reported by the caller
        return folder
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise DatasetError(
            f"{source / _LIST}: names {name[:40]!r} ({reason}); correct it"
        ) from None
    return folder


def _reason_against(folder: Path) -> str:
    """Why the toolkit cannot use a folder as a sequence; empty if it can."""
    if not (folder / _TRUTH).is_file():
        return f"has no {_TRUTH}"
    try:
        read_vot(folder)
    except DatasetError as error:
        return one_line(error)
    return ""


def _length_of(folder: Path) -> int:
    """Number of frames of a sequence, by its ground truth."""
    return len(read_text(folder / _TRUTH).split())


def _is_official(stack: str) -> bool:
    """Whether `stack` is a name of the toolkit ("vot2018/shortterm") and not an existing file."""
    return _OFFICIAL.fullmatch(stack) is not None and not Path(stack).is_file()


def _read_stack(path: Path) -> str:
    """The text of a stack's file; `ArgumentError` if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise ArgumentError(
            f"stack {path} is not a file that can be read, nor a stack of the toolkit; give a YAML "
            "file, or a name such as vot2018/shortterm"
        ) from None


def _supervised_stack(lengths: list[int]) -> str:
    """A stack with one supervised run, for sequences of the given lengths in frames."""
    return _SUPERVISED.format(**_interval_for(lengths)._asdict())


def _interval_for(lengths: list[int]) -> Interval:
    """An EAO interval that fits sequences of the given lengths in frames."""
    shortest = min(lengths)
    return Interval(max(1, round(_LOW * shortest)), max(1, round(_HIGH * shortest)))
