"""`open_results`: tracks as text files, one line per target and frame."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeAlias

from ssiam.copying import NotCopyable
from ssiam.errors import SinkError
from ssiam.outputs import ClosedOnExit, PartFile, check_output, output_error
from ssiam.track import Track
from ssiam.video.mask_codec import encode_mask

COLUMNS = (
    *("frame", "time", "target", "x", "y", "w", "h", "score", "lost"),
    *("x1", "y1", "x2", "y2", "x3", "y3", "x4", "y4"),
    *("dx", "dy", "angle_rad", "inliers", "reliable", "keyframe"),
)
"""Columns of .csv and keys of .jsonl.

Pixels, 0-based; seconds; radians. `dx`, `dy` and `angle_rad` are the camera motion since the
previous frame, at the image center; `inliers` is the share of points that agree with it.
`keyframe`: the box was given by a person, not tracked. All columns after `target` are empty (null)
while a target waits for the frame in which it begins.
"""

MASK_COLUMN = "mask"
"""Last column of results with masks: COCO's compressed run lengths (`ssiam.video.mask_codec`)."""

STDOUT = "-"
"""Path of results that go to standard output, as JSON lines."""

# Decimals: a thousandth of a pixel, a microsecond, a microradian.
_PIXEL_DECIMALS, _SCORE_DECIMALS, _FINE_DECIMALS = 3, 4, 6
_STDOUT_DEVICE = Path("/dev/stdout")
_TEXT_LAYOUTS = ("otb", "vot", "mot")
_BY_SUFFIX = {".csv": "csv", ".jsonl": "jsonl", ".txt": _TEXT_LAYOUTS[0]}

_Value: TypeAlias = float | int | bool | str | None


@dataclass(frozen=True)
class Row:
    """One target in one frame: `frame` from 0, `time` in seconds or None, `target` from 1.

    `track` is None before the target begins.
    """

    frame: int
    time: float | None
    target: int
    track: Track | None


def open_results(
    path: str | Path,
    *,
    layout: str | None = None,
    targets: int = 1,
    overwrite: bool = True,
    masks: bool = False,
) -> ResultSink:
    """Open a sink that writes the tracks of `targets` targets to `path`.

    Parameters
    ----------
    path : str or Path
        ``.csv`` (a table), ``.jsonl`` (its rows as JSON objects) or ``.txt``; ``-`` for standard
        output, as JSON objects. Pixels are 0-based, frames count from 0 and targets from 1, unless
        the layout differs.
    layout : "otb", "vot", "mot" or None
        Layout of a ``.txt``; None means "otb". otb: ``x,y,w,h``, 1-based. vot: ``x,y,w,h`` or
        four corners, 0-based, after a first line ``1``. mot: all targets in one file, 1-based.
    targets : int
        Number of tracks passed to every `ResultSink.write`. otb and vot hold one target per file:
        for several, ``name.txt`` becomes ``name_1.txt``, ``name_2.txt``, ...
    overwrite : bool
        Whether existing files may be replaced.
    masks : bool
        Whether .csv and .jsonl have the column `MASK_COLUMN`.

    Raises
    ------
    SinkError
        A file cannot be written, or exists and `overwrite` is False, or the kind of file or the
        layout is unknown, or it cannot hold masks.
    """
    if masks:
        check_holds_masks(path)
    chosen = (_WITH_MASKS if masks else _LAYOUTS)[_layout_name(Path(path), layout)]
    if str(path) == STDOUT:
        return ResultSink([_StandardOutput()], chosen, targets)
    paths = result_paths(path, layout=layout, targets=targets)
    for each in paths:
        check_output(each, overwrite=overwrite)
    files = [_LineFile(PartFile(each, overwrite=overwrite)) for each in paths]
    return ResultSink(files, chosen, targets)


def result_paths(
    path: str | Path, *, layout: str | None = None, targets: int = 1
) -> tuple[Path, ...]:
    """The files that `open_results` writes for the same arguments; raises the same `SinkError`.

    Standard output counts as its device.
    """
    if str(path) == STDOUT:
        _layout_name(Path(path), layout)
        return (_STDOUT_DEVICE,)
    path, chosen = Path(path), _LAYOUTS[_layout_name(Path(path), layout)]
    if targets < 1:
        raise ValueError(f"targets is {targets}; there must be at least 1")
    if targets == 1 or not chosen.one_target:
        return (path,)
    return tuple(path.with_name(f"{path.stem}_{i}{path.suffix}") for i in range(1, targets + 1))


def check_holds_masks(path: str | Path | None) -> None:
    """Raise `SinkError` unless these results can hold masks; None are none."""
    if path is None:
        raise SinkError("masks are written to the results: give --results NAME.csv or NAME.jsonl")
    if _layout_name(Path(path), None) not in _WITH_MASKS:
        raise SinkError(f"{path}: cannot hold masks: write .csv or .jsonl")


def _layout_name(path: Path, layout: str | None) -> str:
    by_suffix = "jsonl" if str(path) == STDOUT else _BY_SUFFIX.get(path.suffix.lower())
    if by_suffix is None:
        known = " ".join(_BY_SUFFIX)
        raise SinkError(f"{path}: unknown kind of results; name it with one of {known}")
    if layout is None or layout == by_suffix:
        return by_suffix
    if path.suffix.lower() != ".txt" or layout not in _TEXT_LAYOUTS:
        known = ", ".join(_TEXT_LAYOUTS)
        raise SinkError(f"{path}: no layout {layout!r} for it; .txt files have one of {known}")
    return layout


class ResultSink(NotCopyable, ClosedOnExit):
    """Writes tracks as lines of text; a context manager. Made by `open_results`.

    Threads: one thread at a time.

    Every line is written at once and completely to ``NAME.part.EXT``, which `close` renames, also
    after Ctrl-C or an exception: an interrupted or killed run leaves complete lines. The part file
    remains if the program is killed or the disk is full.

    Raises
    ------
    SinkError
        On construction, writing or closing: a file cannot be written.
    BrokenPipeError
        On writing: the reader of standard output has closed it.
    """

    def __init__(self, files: Sequence[_Lines], layout: _Layout, targets: int) -> None:
        self._layout = layout
        self._targets = targets
        self._begun: set[int] = set()  # targets that have a track
        self._is_empty = True
        self._files = list(files)
        if layout.header is not None:
            self._files[0].write_line(layout.header)

    @property
    def locations(self) -> tuple[Path, ...]:
        """The files that have the results now: the outputs, or their part files before `close`."""
        return tuple(file.location for file in self._files if file.location is not None)

    def write(self, frame_index: int, time: float | None, tracks: Sequence[Track | None]) -> None:
        """Write the tracks of one frame, in the order of the targets.

        Parameters
        ----------
        frame_index : int
            From 0.
        time : float or None
            Seconds; None if unknown.
        tracks : sequence of Track or None
            In raw-frame pixels, one per target; None before a target begins.

        Raises
        ------
        ValueError
            The number of tracks is not that of the targets.
        """
        if len(tracks) != self._targets:
            raise ValueError(f"{len(tracks)} tracks for {self._targets} targets")
        for target, track in enumerate(tracks, start=1):
            is_initial = track is not None and target not in self._begun
            if is_initial:
                self._begun.add(target)
            if is_initial and self._layout.initial is not None:
                self._file(target).write_line(self._layout.initial)
                self._is_empty = False
            else:
                self.write_row(Row(frame_index, time, target, track))

    def write_row(self, row: Row) -> None:
        """Write one target of one frame; instead of `write` if the number of targets varies."""
        line = self._layout.line(row)
        if line is not None:
            self._file(row.target).write_line(line)
            self._is_empty = False

    def _file(self, target: int) -> _Lines:
        return self._files[target - 1 if self._layout.one_target else 0]

    def close(self) -> None:
        """Close the files and rename them to their final names. May be called twice."""
        for file in self._files:
            file.close()
        for file in self._files:
            file.finish()

    def abandon(self) -> None:
        """Close the files without renaming them: the part files remain, except empty ones."""
        for file in self._files:
            file.close()
            if self._is_empty:
                file.discard()


class _Lines(Protocol):
    """Where lines are written."""

    @property
    def location(self) -> Path | None: ...

    def write_line(self, line: str) -> None: ...

    def close(self) -> None: ...

    def finish(self) -> None: ...

    def discard(self) -> None: ...


class _StandardOutput:
    """Standard output; each line is flushed, so that a reader gets it at once."""

    location: Path | None = None

    def write_line(self, line: str) -> None:
        try:
            print(line, flush=True)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise output_error(_STDOUT_DEVICE, error) from error

    def close(self) -> None:
        """Standard output belongs to the process."""

    def finish(self) -> None:
        """Every line is complete already."""

    def discard(self) -> None:
        """Lines that were written cannot be taken back."""


class _LineFile:
    """An unbuffered file, to which a line is written completely or not at all."""

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
                # A full disk accepts half a line without an error.
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


def _record(row: Row) -> dict[str, _Value]:
    """The row by `COLUMNS`; None for missing values."""
    track = row.track
    if track is None:
        found = (row.frame, _rounded(row.time, _FINE_DECIMALS), row.target)
        return dict(zip(COLUMNS, (*found, *(None,) * (len(COLUMNS) - len(found))), strict=True))
    corners = (None,) * 8 if track.corners is None else track.corners.ravel().tolist()
    values = (
        *(row.frame, _rounded(row.time, _FINE_DECIMALS), row.target),
        *(_rounded(value, _PIXEL_DECIMALS) for value in track.box),
        *(_rounded(track.score, _SCORE_DECIMALS), bool(track.lost)),
        *(_rounded(value, _PIXEL_DECIMALS) for value in corners),
        *_motion_values(track),
        track.keyframe,
    )
    return dict(zip(COLUMNS, values, strict=True))


def _record_with_mask(row: Row) -> dict[str, _Value]:
    """`_record`, and the mask; None if the track has none."""
    mask = None if row.track is None else row.track.mask
    return {**_record(row), MASK_COLUMN: None if mask is None else encode_mask(mask)}


def _csv_line(row: Row) -> str:
    """`_record` separated by commas; missing values are empty, booleans are 0 and 1."""
    return _joined(_record(row).values())


def _json_line(row: Row) -> str:
    """`_record` as one JSON object; missing values are null."""
    return json.dumps(_record(row), allow_nan=False)


def _mot_line(row: Row) -> str | None:
    """MOTChallenge: ``frame,id,x,y,w,h,conf,-1,-1,-1``; frame, id, x and y are 1-based.

    The format has no line for a target that is lost or has not begun.
    """
    if row.track is None or row.track.lost or not _is_finite(row.track.box):
        return None
    box = _one_based(row.track.box)
    score = _rounded(row.track.score, _SCORE_DECIMALS)
    return _joined((row.frame + 1, row.target, *box, score, -1, -1, -1))


def _otb_line(row: Row) -> str:
    """OTB: ``x,y,w,h``; x and y are 1-based. One line per frame, also for a lost target.

    ``0,0,0,0`` before the target begins.
    """
    if row.track is None or not _is_finite(row.track.box):
        return "0,0,0,0"
    return _joined(_one_based(row.track.box))


def _vot_line(row: Row) -> str:
    """VOT: ``x,y,w,h``, or the polygon ``x1,y1,...,x4,y4`` of a rotated box; 0-based pixels.

    One line per frame, also for a lost target; ``0`` before the target begins.
    """
    track = row.track
    if track is None:
        return "0"
    region = track.box if track.corners is None else track.corners.ravel().tolist()
    if not _is_finite(region):
        return "0"
    return _joined(_rounded(value, _PIXEL_DECIMALS) for value in region)


@dataclass(frozen=True)
class _Layout:
    """A text format.

    Attributes
    ----------
    line : callable
        The line of a `Row`; None writes no line.
    header : str or None
        First line of the file.
    initial : str or None
        Replaces the line of the frame in which a target begins.
    one_target : bool
        Whether each target has its own file.
    """

    line: Callable[[Row], str | None]
    header: str | None = None
    initial: str | None = None
    one_target: bool = False


_WITH_MASKS = {
    "csv": _Layout(
        lambda row: _joined(_record_with_mask(row).values()),
        header=",".join((*COLUMNS, MASK_COLUMN)),
    ),
    "jsonl": _Layout(lambda row: json.dumps(_record_with_mask(row), allow_nan=False)),
}

_LAYOUTS = {
    "csv": _Layout(_csv_line, header=",".join(COLUMNS)),
    "jsonl": _Layout(_json_line),
    "mot": _Layout(_mot_line),
    "otb": _Layout(_otb_line, one_target=True),
    "vot": _Layout(_vot_line, initial="1", one_target=True),
}


def _motion_values(track: Track) -> tuple[_Value, ...]:
    if track.motion is None:
        return (None,) * 5
    dx, dy, angle = track.motion.shift_angle
    return (
        _rounded(dx, _PIXEL_DECIMALS),
        _rounded(dy, _PIXEL_DECIMALS),
        _rounded(angle, _FINE_DECIMALS),
        _rounded(track.motion.inliers, _SCORE_DECIMALS),
        bool(track.motion.reliable),
    )


def _one_based(xywh: Iterable[float]) -> tuple[_Value, ...]:
    x, y, w, h = (_rounded(value, _PIXEL_DECIMALS) for value in xywh)
    return _rounded((x or 0) + 1, _PIXEL_DECIMALS), _rounded((y or 0) + 1, _PIXEL_DECIMALS), w, h


def _rounded(value: float | None, decimals: int) -> float | None:
    """Rounded value, never -0.0; None if it is not finite, which no format can represent."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), decimals) + 0.0


def _is_finite(values: Iterable[float]) -> bool:
    return all(math.isfinite(value) for value in values)


def _joined(values: Iterable[_Value]) -> str:
    return ",".join(_text(value) for value in values)


def _text(value: _Value) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:.{_FINE_DECIMALS}f}".rstrip("0").rstrip(".")
    return str(int(value))
