"""`open_results`: tracks into text files, line by line."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ssiam.copying import NotCopied
from ssiam.errors import SinkError
from ssiam.trackers import Track
from ssiam.video.layouts import LAYOUTS, Layout, Row
from ssiam.video.outputs import check_output, output_error

TEXT_LAYOUTS = ("otb", "vot", "mot")

_BY_SUFFIX = {".csv": "csv", ".jsonl": "jsonl", ".txt": TEXT_LAYOUTS[0]}


def open_results(path: str | Path, *, layout: str | None = None, targets: int = 1) -> ResultSink:
    """A sink that writes the tracks of `targets` targets to `path`.

    Parameters
    ----------
    path : str or Path
        ``.csv`` (a table), ``.jsonl`` (its rows as JSON objects) or ``.txt``; replaced if it
        exists. Pixels are 0-based and frames are counted from 0, targets from 1, unless the
        layout says otherwise.
    layout : "otb", "vot", "mot" or None
        Of a ``.txt``; None means "otb". otb: ``x,y,w,h``, 1-based. vot: ``x,y,w,h`` or four
        corners, 0-based, after a first line ``1``. mot: all targets in one file, 1-based.
    targets : int
        How many targets every `ResultSink.write` brings. otb and vot hold one target a file:
        for several, ``name.txt`` becomes ``name_1.txt``, ``name_2.txt``, ...

    Raises
    ------
    SinkError
        If a file cannot be written, or for an unknown kind of file or layout.
    """
    chosen = LAYOUTS[_layout_name(Path(path), layout)]
    if targets < 1:
        raise ValueError(f"targets is {targets}; there must be at least 1")
    return ResultSink(_paths(Path(path), targets if chosen.one_target else 1), chosen, targets)


def _layout_name(path: Path, layout: str | None) -> str:
    by_suffix = _BY_SUFFIX.get(path.suffix.lower())
    if by_suffix is None:
        known = " ".join(_BY_SUFFIX)
        raise SinkError(f"{path}: unknown kind of results; name it with one of {known}")
    if layout is None or layout == by_suffix:
        return by_suffix
    if path.suffix.lower() != ".txt" or layout not in TEXT_LAYOUTS:
        known = ", ".join(TEXT_LAYOUTS)
        raise SinkError(f"{path}: no layout {layout!r} for it; .txt files have one of {known}")
    return layout


def _paths(path: Path, count: int) -> list[Path]:
    if count == 1:
        return [path]
    return [path.with_name(f"{path.stem}_{number}{path.suffix}") for number in range(1, count + 1)]


class ResultSink(NotCopied):
    """Writes tracks as lines; a context manager. Made by `open_results`.

    Threads: one thread at a time.

    Every line is written whole and at once: a run that is interrupted leaves complete lines.
    """

    def __init__(self, paths: Sequence[Path], layout: Layout, targets: int) -> None:
        for path in paths:
            check_output(path)
        self._layout = layout
        self._targets = targets
        self._is_first = True
        self._files = [_LineFile(path) for path in paths]
        if layout.header is not None:
            self._files[0].write_line(layout.header)

    def write(self, frame_index: int, time: float | None, tracks: Sequence[Track]) -> None:
        """Write the tracks of one frame, in the order of the targets.

        `frame_index` counts from 0; `time` in seconds, None if unknown.
        """
        if len(tracks) != self._targets:
            raise ValueError(f"{len(tracks)} tracks for {self._targets} targets")
        for number, track in enumerate(tracks):
            if self._is_first and self._layout.initial is not None:
                self._file(number + 1).write_line(self._layout.initial)
            else:
                self.write_row(Row(frame_index, time, number + 1, track))
        self._is_first = False

    def write_row(self, row: Row) -> None:
        """Write one target of one frame, where targets come and go."""
        line = self._layout.line(row)
        if line is not None:
            self._file(row.target).write_line(line)

    def _file(self, target: int) -> _LineFile:
        return self._files[target - 1 if self._layout.one_target else 0]

    def close(self) -> None:
        """Close the files. May be called twice."""
        for file in self._files:
            file.close()

    def __enter__(self) -> ResultSink:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


class _LineFile:
    """A file without buffer, so that a line is in it or is not."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise output_error(path, error) from error

    def write_line(self, line: str) -> None:
        data = f"{line}\n".encode("ascii")
        try:
            written = self._file.write(data)
            if written < len(data):
                # A full disk takes half a line without complaint.
                self._file.truncate(self._file.tell() - written)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise output_error(self._path, error) from error

    def close(self) -> None:
        with suppress(OSError):
            self._file.close()
