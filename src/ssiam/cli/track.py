"""`ssiam track`: track one or several targets through a video."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Group, Parameter
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as RichProgress

from ssiam.cli.options import (
    DEFAULT_STABILIZATION,
    DEFAULT_TRACKER_OPTIONS,
    RUNTIME_GROUP,
    TARGET_GROUP,
    StabilizationOptions,
    TrackerOptions,
    parse_levels,
    report_leftover_parts,
)
from ssiam.cli.track_outputs import OutputPaths, Outputs
from ssiam.errors import ArgumentError, IncompleteError, StreamError, one_line
from ssiam.geometry import XYWH, Transform, frame_center, rigid_parameters
from ssiam.track import Track
from ssiam.trackers import TrackerGroup
from ssiam.video import Frame, RawFormat, Source, open_source, with_following

_log = logging.getLogger(__name__)

_OUTPUT_GROUP = Group("Output", sort_key=2)
_SMOOTHING = 0.9  # weight of the past in the running mean of the time per frame


def track(
    source: Annotated[str, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    box: Annotated[
        list[str],
        Parameter(group=TARGET_GROUP, negative=(), allow_leading_hyphen=True),
    ],
    out: Annotated[Path | None, Parameter(group=_OUTPUT_GROUP)] = None,
    results: Annotated[Path | None, Parameter(group=_OUTPUT_GROUP)] = None,
    layout: Annotated[str | None, Parameter(group=_OUTPUT_GROUP)] = None,
    plot: Annotated[Path | None, Parameter(group=_OUTPUT_GROUP)] = None,
    side_by_side: Annotated[bool, Parameter(group=_OUTPUT_GROUP, negative=())] = False,
    overwrite: Annotated[bool, Parameter(group=_OUTPUT_GROUP, negative=())] = False,
    raw: Annotated[str | None, Parameter(group=RUNTIME_GROUP)] = None,
    stream: Annotated[int | None, Parameter(group=RUNTIME_GROUP)] = None,
    levels: Annotated[str | None, Parameter(group=RUNTIME_GROUP, allow_leading_hyphen=True)] = None,
    tracker_options: TrackerOptions = DEFAULT_TRACKER_OPTIONS,
    config: StabilizationOptions = DEFAULT_STABILIZATION,
) -> None:
    """Track targets through a video from a moving camera.

    Without --out, --results and --plot, the annotated video and a CSV file are written to the
    current folder. They are named after the source, and numbered if such files exist:
    clip-tracked.mp4, clip-tracked-2.mp4.

    Each output is written to NAME.part.EXT, which is renamed at the end, also after Ctrl-C. If a
    run is killed, its partial video can be played and its partial results consist of complete
    lines. An output must not be an input.

    Parameters
    ----------
    source
        Video file, folder of images, camera index, rtsp:// or http:// address, or - for standard
        input.
    box
        Target in the first frame: x,y,width,height in pixels, with x and y of its top left corner.
        Repeat for further targets.
    out
        Annotated video to write, in H.264: .mp4, .mkv, .mov or .avi. The sound of the source is
        copied.
    results
        Results to write: .csv, .jsonl or .txt.
    layout
        Layout of a .txt file: otb (x,y,w,h, 1-based; the default), mot (MOTChallenge, 1-based) or
        vot (0-based).
    plot
        Plot of the camera path and its stabilization: .png, .svg or .pdf.
    side_by_side
        Show the stabilized view next to the raw frame in the video.
    overwrite
        Replace existing files; without this option ssiam does not start.
    raw
        SIZE,PIXEL_FORMAT,FPS of raw frames without a header, in a file or from standard input:
        640x360,bgr24,30.
    stream
        Index of the video stream, from 0; by default the one with the most pixels.
    levels
        LOW,HIGH: the values shown as black and as white, for sources with more than 8 bits per
        value, such as thermal cameras: 7000,8500. By default estimated from the first frames.
    """
    boxes = [_box(text) for text in box]
    if out is None and results is None and plot is None:
        paths = OutputPaths.default(_stem(source), len(boxes), overwrite)
    else:
        paths = OutputPaths.explicit(out, results, plot, layout, len(boxes), overwrite)
    paths.check(source, tracker_options.weight_files())
    report_leftover_parts(paths.leftover_parts)
    with ExitStack() as stack:
        frames = stack.enter_context(
            open_source(
                source,
                raw=_raw_format(raw),
                stream=stream,
                levels=parse_levels(levels),
                sound=paths.video is not None,
            )
        )
        first = next(frames)
        group = TrackerGroup(tracker_options.load(config), keep_going=True)
        group.init(first.image, boxes)
        outputs = Outputs(frames, paths, side_by_side=side_by_side, config=config)
        summary = _Summary(frames.name, tracker_options.tracker, config.stabilize, len(boxes))
        stack.callback(lambda: summary.print(outputs.locations(), _notes(frames, outputs)))
        stack.enter_context(outputs)
        _track_frames(group, first, frames, boxes, outputs, summary, tracker_options.threads)
    summary.check_complete()
    if frames.info.undecoded:
        raise StreamError(
            f"{frames.name}: {_undecoded(frames)}; the frames before and after them were tracked"
        )


def _notes(frames: Source, outputs: Outputs) -> list[str]:
    """Notes for the user about the source and the outputs, one line each."""
    undecoded = [_undecoded(frames)] if frames.info.undecoded else []
    return [*(f"source: {line}" for line in (*frames.info.notes, *undecoded)), *outputs.notes]


def _undecoded(frames: Source) -> str:
    count = frames.info.undecoded
    return f"{count} frame{'s' * (count > 1)} could not be decoded and were skipped"


def _track_frames(
    group: TrackerGroup,
    first: Frame,
    frames: Source,
    boxes: Sequence[XYWH],
    outputs: Outputs,
    summary: _Summary,
    threads: int,
) -> None:
    """Track to the end of the frames."""
    outputs.write(first, [Track(box) for box in boxes])
    with _Progress(frames.length) as progress:
        for frame, following in _paired(frames, threads):
            with summary.timer:
                tracks = group.update(frame.image, None if following is None else following.image)
            summary.add(tracks)
            summary.add_failures(frame.index, group)
            outputs.write(frame, tracks, summary.timer.fps)
            progress.advance(summary.timer.fps)


def _paired(frames: Source, threads: int) -> Iterator[tuple[Frame, Frame | None]]:
    """Each frame with the next one if that is available and a second core may work on it."""
    if frames.length is not None and threads > 1:
        return with_following(frames)
    return ((frame, None) for frame in frames)


def _box(text: str) -> XYWH:
    try:
        x, y, w, h = (float(number) for number in text.split(","))
    except ValueError:
        raise ArgumentError(
            f"--box {text!r} is not a box: give x,y,width,height in pixels, such as 120,80,40,60"
        ) from None
    return x, y, w, h


def _raw_format(text: str | None) -> RawFormat | None:
    if text is None:
        return None
    try:
        size, pixel_format, fps = text.split(",")
        width, height = (int(number) for number in size.split("x"))
        return RawFormat((width, height), pixel_format, Fraction(fps))
    except (ValueError, ZeroDivisionError):
        raise ArgumentError(
            f"--raw {text!r} is not a raw format: give size, pixel format and rate, "
            "such as 640x360,bgr24,30"
        ) from None


def _stem(source: str) -> str:
    """Base name of outputs: name of the file or folder, index of the camera, or "stream"."""
    stem = Path(source.split("?")[0]).stem if "://" not in source else ""
    return stem if stem not in ("", "-") else "stream"


class _Timer:
    """Measures the time spent in a `with` block: the tracking, without decoding and drawing."""

    def __init__(self) -> None:
        self.total = 0.0
        self._start = 0.0
        self._recent: float | None = None

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *exc: object) -> None:
        elapsed = time.perf_counter() - self._start
        self.total += elapsed
        recent = elapsed if self._recent is None else self._recent
        self._recent = _SMOOTHING * recent + (1 - _SMOOTHING) * elapsed

    @property
    def fps(self) -> float | None:
        """Recent frames per second; None before the first frame."""
        return 1 / self._recent if self._recent else None


class _Progress:
    """A progress bar on standard error, if that is a terminal."""

    def __init__(self, length: int | None) -> None:
        console = Console(file=sys.stderr)
        self._bar = RichProgress(
            TextColumn("tracking"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[speed]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("tracking", total=length, completed=1, speed="")

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._bar.stop()

    def advance(self, fps: float | None) -> None:
        """Count one frame as done."""
        self._bar.update(self._task, advance=1, speed="" if fps is None else f"{fps:.0f} fps")


class _Summary:
    """Statistics of a run, printed at its end."""

    def __init__(self, source: str, tracker: str, stabilize: str, targets: int) -> None:
        self.timer = _Timer()
        self._title = f"{source} with {tracker}, stabilize={stabilize}"
        self._frames = 1
        self._reliable = 0
        self._lost = np.zeros(targets, dtype=int)
        self._score = np.zeros(targets)
        self._moved = np.zeros(2)  # px, summed: raw, stabilized
        self._prev_stab_from_raw: Transform | None = None
        self._failures: dict[str, list[str]] = {}  # target or camera -> frame and error of each

    def add(self, tracks: Sequence[Track]) -> None:
        """Count one tracked frame."""
        self._frames += 1
        self._lost += [track.lost for track in tracks]
        self._score += [track.score for track in tracks]
        motion, stab_from_raw = tracks[0].motion, tracks[0].stab_from_raw
        if motion is None or stab_from_raw is None:
            return
        self._reliable += motion.reliable
        if self._prev_stab_from_raw is not None:
            stabilized = (
                stab_from_raw @ motion.cur_from_prev @ np.linalg.inv(self._prev_stab_from_raw)
            )
            center = frame_center(motion.size_wh)
            shifts = motion.shift_angle[:2], rigid_parameters(stabilized, center)[:2]
            self._moved += np.hypot(*np.transpose(shifts))
        self._prev_stab_from_raw = stab_from_raw

    def add_failures(self, frame_index: int, group: TrackerGroup) -> None:
        """Record the targets, or the camera motion, that failed in a frame."""
        failed: dict[str, Exception] = {
            f"target {index + 1}": error for index, error in group.failures.items()
        }
        if group.camera_failure is not None:
            failed["camera"] = group.camera_failure
        for name, error in failed.items():
            self._failures.setdefault(name, []).append(f"frame {frame_index}: {one_line(error)}")
            if len(self._failures[name]) == 1:
                _log.debug("%s, frame %d", name, frame_index, exc_info=error)

    def check_complete(self) -> None:
        """Raise `IncompleteError` if a target or the camera motion failed in some frame."""
        for name, errors in self._failures.items():
            raise IncompleteError(
                f"{name} could not be tracked in {len(errors)} of {self._frames} frames, which "
                f"count as lost; the first is {errors[0]}"
            )

    def print(self, written: Sequence[tuple[str, Path]], notes: Sequence[str] = ()) -> None:
        """Print the summary.

        Parameters
        ----------
        written : sequence of (str, Path)
            Kind and location of each output.
        notes : sequence of str
            Further lines.
        """
        tracked = max(self._frames - 1, 1)
        speed = tracked / self.timer.total if self.timer.total else 0.0
        print(f"tracked {self._frames} frames of {self._title}: {speed:.0f} fps")
        for number, (lost, score) in enumerate(zip(self._lost, self._score, strict=True), 1):
            print(f"  target {number}: lost in {lost} frames, mean score {score / tracked:.2f}")
        for name, errors in self._failures.items():
            print(f"  {name}: failed in {len(errors)} frames, the first is {errors[0]}")
        if self._prev_stab_from_raw is not None:
            raw, stabilized = self._moved / tracked
            print(
                f"  camera: motion known in {100 * self._reliable / tracked:.0f} % of the frames, "
                f"{raw:.1f} px per frame, {stabilized:.1f} px in the stabilized view"
            )
        for kind, path in written:
            print(f"  {kind}: {path}")
        for note in notes:
            print(f"  {note}")
