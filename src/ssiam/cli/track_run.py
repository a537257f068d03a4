"""`run_track`: targets are tracked through a source, and everything is written."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import partial
from types import TracebackType

from ssiam.cli.moments import WHOLE_SOURCE, PlannedTarget, Span, begins_before_start
from ssiam.cli.options import TrackerOptions, report_uncalibrated
from ssiam.cli.static_areas import NO_STATIC_AREAS, StaticAreas
from ssiam.cli.track_outputs import OutputPaths, Outputs
from ssiam.cli.track_progress import RunProgress
from ssiam.cli.track_records import TrackRecords
from ssiam.cli.track_summary import Summary
from ssiam.cli.track_targets import TargetSet
from ssiam.cli.track_views import (
    VideoOptions,
    ViewMotion,
    first_box,
    live_views,
    planned_views,
)
from ssiam.errors import ArgumentError, IncompleteError, SinkError, StreamError
from ssiam.geometry import XYWH, check_box
from ssiam.motion import Motion
from ssiam.stabilize import StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import TrackerGroup
from ssiam.video import Frame, RawFormat, Source, open_source, with_following
from ssiam.video.results import STDOUT
from ssiam.video.reversing import is_reversible

DEFAULT_VIDEO = VideoOptions()


@dataclass(frozen=True)
class SourceOptions:
    """A source and how it is opened; the fields are the arguments of `open_source`."""

    spec: str = field(repr=False)
    raw: RawFormat | None = None
    stream: int | None = None
    levels: tuple[float, float] | None = None

    def open(self, *, sound: bool = False) -> Source:
        """Open the source; raises as `open_source`."""
        return open_source(
            self.spec, raw=self.raw, stream=self.stream, levels=self.levels, sound=sound
        )


@dataclass(frozen=True)
class TrackJob:
    """Everything about a tracking run except its targets.

    Attributes
    ----------
    source : SourceOptions
    paths : OutputPaths
        Of as many targets as are given to `run_track`; checked.
    tracker : TrackerOptions
    config : StabilizerConfig
    span : Span
        The frames that are tracked and written.
    video : VideoOptions
    quiet : bool
        Whether no summary is printed.
    static_areas : StaticAreas
        What moves with the camera; `run_track` checks it against the size of the frames.
    """

    source: SourceOptions
    paths: OutputPaths
    tracker: TrackerOptions
    config: StabilizerConfig
    span: Span = WHOLE_SOURCE
    video: VideoOptions = DEFAULT_VIDEO
    quiet: bool = False
    static_areas: StaticAreas = NO_STATIC_AREAS

    @property
    def needs_motion(self) -> bool:
        """Whether the video needs the camera motion."""
        return self.paths.video is not None and self.video.needs_motion

    @property
    def plans_views(self) -> bool:
        """Whether the views of the video are planned for the whole clip, which is read again."""
        is_virtual = self.paths.video is not None and self.video.is_virtual
        return is_virtual and is_reversible(self.source.spec)

    def new_group(self) -> TrackerGroup:
        """A group of the job's tracker without targets; raises as `load_tracker`."""
        tracker = self.tracker.load(self.config, self.static_areas.mask)
        if not (self.quiet or tracker.score_is_calibrated):
            report_uncalibrated(self.tracker.tracker)
        return TrackerGroup(tracker, keep_going=True)

    def new_view_motion(self) -> ViewMotion | None:
        """What estimates the camera motion for the video; None if it needs none."""
        return ViewMotion(self.static_areas.mask) if self.needs_motion else None


def run_track(
    job: TrackJob, targets: Sequence[PlannedTarget], progress: Sequence[RunProgress] = ()
) -> None:
    """Track `targets` through the source of `job` and write its outputs.

    The outputs are finished under their names at the end of the source, after Ctrl-C, and if the
    source breaks off.

    Parameters
    ----------
    job : TrackJob
    targets : sequence of PlannedTarget
        At least one, in the order of their numbers.
    progress : sequence of RunProgress
        Each receives every frame and the end.

    Raises
    ------
    SsiamError
        Before anything is written: the source cannot be opened, the span, a box or a static area
        does not fit it, or an output cannot be written. Later: the source or an output fails.
    IncompleteError
        At the end: a target failed on some frames or never began.
    """
    with ExitStack() as stack:
        has_sound = job.paths.video is not None and not job.plans_views
        frames = stack.enter_context(job.source.open(sound=has_sound))
        selected = selected_frames(frames, job.span, targets)
        first = next(selected)
        for target in targets:
            check_target_box(target, frames.size_wh)
        job.static_areas.check(frames.size_wh)
        run = TargetSet(job.new_group(), targets, partial(_has_begun, targets))
        tracks = run.step(first)
        outputs = Outputs(job.paths, job.config)
        summary = Summary(frames.name, job.tracker.tracker, job.config.stabilize, len(targets))
        stack.callback(lambda: report_end(job, frames, outputs, summary, progress))
        again = stack.enter_context(ExitStack())  # closed after the outputs
        stack.enter_context(outputs)
        second_pass: SecondPass | None = None
        if job.plans_views:
            second_pass = stack.enter_context(SecondPass(job, outputs, again, progress))
        else:
            views = live_views(job.video, frames.size_wh, float(frames.fps))
            outputs.open_video(frames, job.video, views)
        total = _expected_count(frames, job.span, first)
        passes = 1 if second_pass is None else 2
        camera = job.new_view_motion()

        def write(frame: Frame, tracks: Sequence[Track | None], motion: Motion | None) -> None:
            summary.add(frame.index, tracks)
            summary.add_failures(frame.index, run.failures)
            outputs.write(frame, tracks)
            if second_pass is None:
                outputs.write_video(frame, tracks, motion, summary.timer.fps)
            else:
                second_pass.add(frame, tracks, motion)
            for each in progress:
                each.advance(summary.frames, total and passes * total, summary.timer.fps)

        write(first, tracks, None if camera is None else camera.finish(first, tracks))
        for frame, following in paired_frames(selected, frames.length, job.tracker.threads):
            with summary.timer:
                if camera is not None:
                    camera.start(frame)
                tracks = run.step(frame, following)
                motion = None if camera is None else camera.finish(frame, tracks)
            write(frame, tracks, motion)
    check_complete(frames, summary, run.waiting)


class SecondPass:
    """Reads the source again and writes the video; a context manager around the first pass.

    The video is written on exit, also after Ctrl-C or if the source breaks off: its frames are
    those that were tracked. Ctrl-C during the second pass ends the video there.

    Parameters
    ----------
    job : TrackJob
    outputs : Outputs
        Without a video; it is opened here.
    stack : ExitStack
        Closes the source, after the outputs.
    progress : sequence of RunProgress
    """

    def __init__(
        self,
        job: TrackJob,
        outputs: Outputs,
        stack: ExitStack,
        progress: Sequence[RunProgress],
    ) -> None:
        self._job, self._outputs, self._stack, self._progress = job, outputs, stack, progress
        has_outlines = job.video.overlay != "none"
        self._records = TrackRecords(job.paths.targets, has_outlines=has_outlines)
        self._motions: list[Motion] = []
        self._boxes: list[XYWH | None] = []  # of the first target
        self._first = self._last = 0

    def add(self, frame: Frame, tracks: Sequence[Track | None], motion: Motion | None) -> None:
        """Record what is known of a frame."""
        height, width = frame.image.shape[:2]
        if not self._records:
            self._first = frame.index
        self._motions.append(motion or Motion.none((width, height)))
        self._boxes.append(first_box(tracks))
        self._records.add(frame.index, tracks)
        self._last = frame.index

    def __enter__(self) -> SecondPass:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        count = len(self._records)
        if not count or isinstance(exc, SinkError):
            return
        if isinstance(exc, KeyboardInterrupt) and not self._job.quiet:
            print(
                f"ssiam: interrupted; writes the video of {count} frames (Ctrl-C ends that too)",
                file=sys.stderr,
            )
        self._write(count)

    def _write(self, count: int) -> None:
        job = self._job
        frames = self._stack.enter_context(job.source.open(sound=True))
        first = self._first
        views = planned_views(
            job.video,
            frames,
            range(first, first + count),
            lambda index: self._motions[index - first],
            lambda index: self._boxes[index - first],
        )
        self._outputs.open_video(frames, job.video, views)
        span = Span.of_frames(first, self._last)
        # Closed before the source: the other thread may still decode.
        with closing(_decoded_ahead(selected_frames(frames, span, ()))) as selected:
            for done, frame in enumerate(selected, 1):
                motion = self._motions[frame.index - first]
                self._outputs.write_video(frame, self._records.tracks(frame.index), motion)
                for each in self._progress:
                    each.advance(count + done, 2 * count, None)


def _decoded_ahead(frames: Iterator[Frame]) -> Generator[Frame, None, None]:
    """The frames; each is decoded in another thread while the one before it is written."""
    with ThreadPoolExecutor(1, "decoding") as worker:
        upcoming = worker.submit(next, frames, None)
        while (frame := upcoming.result()) is not None:
            upcoming = worker.submit(next, frames, None)
            yield frame


def _has_begun(targets: Sequence[PlannedTarget], index: int, frame: Frame) -> bool:
    begins = targets[index].begins
    return begins is None or begins.is_reached(frame)


def selected_frames(
    frames: Source, span: Span, targets: Sequence[PlannedTarget]
) -> Generator[Frame, None, None]:
    """The frames of the span.

    Raises
    ------
    ArgumentError
        The span has no frame, or a target begins before it.
    """
    start, end = span.start, span.end
    count, is_begun = 0, False
    for frame in frames:
        count += 1
        if start is not None and not is_begun and not start.is_reached(frame):
            for target in targets:
                if target.begins is not None and target.begins.is_reached(frame):
                    raise ArgumentError(begins_before_start(target, start))
            if frames.info.sound is not None and frame.time is not None:
                frames.info.sound.skip_until(frame.time)
            continue
        if end is not None and end.is_passed(frame):
            break
        is_begun = True
        yield frame
        if end is not None and end.frame == frame.index:
            break
    if is_begun or start is None:
        return
    if end is not None and count and end.is_passed(frame):
        raise ArgumentError(f"--end {end.text} is before --start {start.text}: swap them")
    raise ArgumentError(
        f"--start {start.text} is after the end of {frames.name}, which has {count} frames: "
        "give an earlier one"
    )


def _expected_count(frames: Source, span: Span, first: Frame) -> int | None:
    """About how many frames the run will have; None if that is unknown."""
    end = span.end
    ends = [] if frames.length is None else [frames.length]
    if end is not None and end.frame is not None:
        ends.append(end.frame + 1)
    if end is not None and end.seconds is not None:
        ends.append(round(end.seconds * frames.fps) + 1)
    return max(min(ends) - first.index, 1) if ends else None


def paired_frames(
    selected: Iterator[Frame], length: int | None, threads: int
) -> Iterator[tuple[Frame, Frame | None]]:
    """Each frame with the next one if that is available and a second core may work on it."""
    if length is not None and threads > 1:
        return with_following(selected)
    return ((frame, None) for frame in selected)


def check_target_box(target: PlannedTarget, size_wh: tuple[int, int]) -> None:
    """Raise `ArgumentError`, with the target's label, for a box that does not fit the frame."""
    try:
        check_box(target.xywh, size_wh)
    except ArgumentError as error:
        raise ArgumentError(f"{target.label}: {error}") from None


def report_end(
    job: TrackJob,
    frames: Source,
    outputs: Outputs,
    summary: Summary,
    progress: Sequence[RunProgress],
) -> None:
    """Report the end of a run, after its outputs are closed."""
    for each in progress:
        each.finished(outputs.locations())
    if job.quiet:
        return
    undecoded = [_undecoded(frames)] if frames.info.undecoded else []
    source_notes = [f"source: {line}" for line in (*frames.info.notes, *undecoded)]
    notes = [*source_notes, *outputs.notes]
    is_piped = str(job.paths.results) == STDOUT
    summary.print(sys.stderr if is_piped else sys.stdout, outputs.locations(), notes)


def check_complete(frames: Source, summary: Summary, waiting: Sequence[PlannedTarget] = ()) -> None:
    """Raise the error of a run that reached its end with parts missing.

    `waiting` are the targets that have not begun.
    """
    summary.check_complete()
    for target in waiting:
        raise IncompleteError(
            f"{target.label} begins after the last frame that was read of {frames.name}: it was "
            "not tracked; give an earlier frame"
        )
    if frames.info.undecoded:
        raise StreamError(
            f"{frames.name}: {_undecoded(frames)}; the frames before and after them were tracked"
        )


def _undecoded(frames: Source) -> str:
    count = frames.info.undecoded
    return f"{count} frame{'s' * (count > 1)} could not be decoded and were skipped"
