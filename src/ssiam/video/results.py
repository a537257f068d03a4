"""`open_results`: tracks into text files, line by line."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ssiam.copying import NotCopyable
from ssiam.errors import SinkError
from ssiam.outputs import ClosedOnExit, PartFile, check_output
from ssiam.track import Track
from ssiam.video.layouts import LAYOUTS, Layout, Row

TEXT_LAYOUTS = ("otb", "vot", "mot")

_BY_SUFFIX = {".csv": "csv", ".jsonl": "jsonl", ".txt": TEXT_LAYOUTS[0]}


def open_results(
    path: str | Path, *, layout: str | None = None, targets: int = 1, overwrite: bool = True
) -> ResultSink:
    """A sink that writes the tracks of `targets` targets to `path`.

    Parameters
    ----------
    path : str or Path
        ``.csv`` (a table), ``.jsonl`` (its rows as JSON objects) or ``.txt``. Pixels are 0-based
        and frames are counted from 0, targets from 1, unless the layout says otherwise.
    layout : "otb", "vot", "mot" or None
        Of a ``.txt``; None means "otb". otb: ``x,y,w,h``, 1-based. vot: ``x,y,w,h`` or four
        corners, 0-based, after a first line ``1``. mot: all targets in one file, 1-based.
    targets : int
        How many targets every `ResultSink.write` brings. otb and vot hold one target a file:
        for several, ``name.txt`` becomes ``name_1.txt``, ``name_2.txt``, ...
    overwrite : bool
        Whether files of these names may be replaced.

    Raises
    ------
    SinkError
        If a file cannot be written, or exists and is not to be replaced, or for an unknown kind
        of file or layout.
    """
    paths = result_paths(path, layout=layout, targets=targets)
    chosen = LAYOUTS[_layout_name(Path(path), layout)]
    return ResultSink(paths, chosen, targets, overwrite=overwrite)


def result_paths(
    path: str | Path, *, layout: str | None = None, targets: int = 1
) -> tuple[Path, ...]:
    """The files that `open_results` writes with the same arguments; `SinkError` as it."""
    path, chosen = Path(path), LAYOUTS[_layout_name(Path(path), layout)]
    if targets < 1:
        raise ValueError(f"targets is {targets}; there must be at least 1")
    if targets == 1 or not chosen.one_target:
        return (path,)
    return tuple(path.with_name(f"{path.stem}_{i}{path.suffix}") for i in range(1, targets + 1))


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


class ResultSink(NotCopyable, ClosedOnExit):
    """Writes tracks as lines; a context manager. Made by `open_results`.

    Threads: one thread at a time.

    Every line is written whole and at once to ``NAME.part.EXT``, which `close` renames, also after
    Ctrl-C or an exception: a run that is interrupted or killed leaves complete lines. If the
    program is killed or the disk is full the part stays.
    """

    def __init__(
        self, paths: Sequence[Path], layout: Layout, targets: int, *, overwrite: bool = True
    ) -> None:
        for path in paths:
            check_output(path, overwrite=overwrite)
        self._layout = layout
        self._targets = targets
        self._is_first = True
        self._is_empty = True
        self._files = [_LineFile(PartFile(path, overwrite=overwrite)) for path in paths]
        if layout.header is not None:
            self._files[0].write_line(layout.header)

    @property
    def locations(self) -> tuple[Path, ...]:
        """Where the results are now: under their names or in their parts."""
        return tuple(file.location for file in self._files if file.location is not None)

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
        self._is_first = self._is_empty = False

    def write_row(self, row: Row) -> None:
        """Write one target of one frame, where targets come and go."""
        line = self._layout.line(row)
        if line is not None:
            self._file(row.target).write_line(line)
            self._is_empty = False

    def _file(self, target: int) -> _LineFile:
        return self._files[target - 1 if self._layout.one_target else 0]

    def close(self) -> None:
        """Close the files and give them their names. May be called twice."""
        for file in self._files:
            file.close()
        for file in self._files:
            file.finish()

    def abandon(self) -> None:
        """Close the files, and leave what is in them under the names of their parts."""
        for file in self._files:
            file.close()
            if self._is_empty:
                file.discard()


class _LineFile:
    """A file without buffer, so that a line is in it or is not."""

    def __init__(self, part: PartFile) -> None:
        self._part = part
        self._failed = False
        try:
            self._file = part.file.open("wb", buffering=0)
        except OSError as error:
            raise part.error(error) from error

    @property
    def location(self) -> Path | None:
        return self._part.location

    def write_line(self, line: str) -> None:
        data = f"{line}\n".encode("ascii")
        try:
            written = self._file.write(data)
            if written < len(data):
                # A full disk takes half a line without complaint.
                self._file.truncate(self._file.tell() - written)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            self._failed = True
            raise self._part.error(error) from error

    def close(self) -> None:
        with suppress(OSError):
            self._file.close()

    def finish(self) -> None:
        if self._failed:
            return
        try:
            self._part.finish()
        except OSError as error:
            self._failed = True
            raise self._part.error(error) from error

    def discard(self) -> None:
        self._part.discard()
