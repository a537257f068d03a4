"""`run_track`: targets are tracked through a source, and everything is written."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

from ssiam.cli.moments import WHOLE_SOURCE, PlannedTarget, Span, begins_before_start
from ssiam.cli.options import TrackerOptions
from ssiam.cli.track_outputs import OutputPaths, Outputs
from ssiam.cli.track_progress import RunProgress
from ssiam.cli.track_summary import Summary
from ssiam.errors import ArgumentError, IncompleteError, StreamError
from ssiam.geometry import check_box
from ssiam.stabilize import StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import TrackerGroup
from ssiam.video import Frame, RawFormat, Source, open_source, with_following
from ssiam.video.results import STDOUT


@dataclass(frozen=True)
class SourceOptions:
    """A source and how it is opened; the fields are the arguments of `open_source`."""

    spec: str
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
    side_by_side : bool
        Whether the video shows the stabilized view too.
    quiet : bool
        Whether no summary is printed.
    """

    source: SourceOptions
    paths: OutputPaths
    tracker: TrackerOptions
    config: StabilizerConfig
    span: Span = WHOLE_SOURCE
    side_by_side: bool = False
    quiet: bool = False


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
        Each is told of every frame and of the end.

    Raises
    ------
    SsiamError
        Before anything is written: the source cannot be opened, the span or a box does not fit
        it, or an output cannot be written. Later: the source or an output fails.
    IncompleteError
        At the end: a target failed on some frames or never began.
    """
    with ExitStack() as stack:
        frames = stack.enter_context(job.source.open(sound=job.paths.video is not None))
        selected = _selected(frames, job.span, targets)
        first = next(selected)
        for target in targets:
            _check_box(target, frames.size_wh)
        run = _Targets(TrackerGroup(job.tracker.load(job.config), keep_going=True), targets)
        tracks = run.step(first)
        outputs = Outputs(frames, job.paths, side_by_side=job.side_by_side, config=job.config)
        summary = Summary(frames.name, job.tracker.tracker, job.config.stabilize, len(targets))
        stack.callback(lambda: _report(job, frames, outputs, summary, progress))
        stack.enter_context(outputs)
        outputs.write(first, tracks)
        summary.add(first.index, tracks)
        done, total = 1, _expected_count(frames, job.span, first)
        for frame, following in _paired(selected, frames.length, job.tracker.threads):
            with summary.timer:
                tracks = run.step(frame, following)
            summary.add(frame.index, tracks)
            summary.add_failures(frame.index, run.failures)
            outputs.write(frame, tracks, summary.timer.fps)
            done += 1
            for each in progress:
                each.advance(done, total, summary.timer.fps)
    _check_complete(frames, run, summary)


class _Targets:
    """The targets of a run, each tracked from the frame in which it begins.

    Attributes
    ----------
    failures : mapping of str to Exception
        What failed in the last frame, by name: "target 2", "camera".
    """

    def __init__(self, group: TrackerGroup, targets: Sequence[PlannedTarget]) -> None:
        self._group = group
        self._targets = targets
        self._order: list[int] = []  # indexes of the targets in the group, in its order
        self.failures: Mapping[str, Exception] = {}

    @property
    def waiting(self) -> list[PlannedTarget]:
        """The targets that have not begun."""
        return [each for index, each in enumerate(self._targets) if index not in self._order]

    def step(self, frame: Frame, following: Frame | None = None) -> list[Track | None]:
        """The targets in the next frame; None for those that have not begun.

        `following` is the frame after it, if that is available.
        """
        starting = [
            index
            for index, target in enumerate(self._targets)
            if index not in self._order
            and (target.begins is None or target.begins.is_reached(frame))
        ]
        tracks: list[Track | None] = [None] * len(self._targets)
        if self._order:
            # The camera motion to the following frame must leave out the new targets too.
            ahead = None if following is None or starting else following.image
            for index, track in zip(
                self._order, self._group.update(frame.image, ahead), strict=True
            ):
                tracks[index] = track
            self.failures = self._named_failures()
        if starting:
            self._begin(frame, starting)
            for index in starting:
                tracks[index] = Track(self._targets[index].xywh, motion=self._group.motion)
        return tracks

    def _begin(self, frame: Frame, starting: Sequence[int]) -> None:
        boxes = [self._targets[index].xywh for index in starting]
        if not self._order:
            self._group.init(frame.image, boxes)
        else:
            for box in boxes:
                tracker = self._group.new_tracker()
                tracker.init(frame.image, box)
                self._group.join(tracker, box)
        self._order += starting

    def _named_failures(self) -> dict[str, Exception]:
        failed = {
            f"target {self._order[position] + 1}": error
            for position, error in self._group.failures.items()
        }
        if self._group.camera_failure is not None:
            failed["camera"] = self._group.camera_failure
        return failed


def _selected(
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


def _paired(
    selected: Iterator[Frame], length: int | None, threads: int
) -> Iterator[tuple[Frame, Frame | None]]:
    """Each frame with the next one if that is available and a second core may work on it."""
    if length is not None and threads > 1:
        return with_following(selected)
    return ((frame, None) for frame in selected)


def _check_box(target: PlannedTarget, size_wh: tuple[int, int]) -> None:
    try:
        check_box(target.xywh, size_wh)
    except ArgumentError as error:
        raise ArgumentError(f"{target.label}: {error}") from None


def _report(
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
    undecoded = [f"source: {_undecoded(frames)}"] if frames.info.undecoded else []
    notes = [*(f"source: {line}" for line in frames.info.notes), *undecoded, *outputs.notes]
    is_piped = str(job.paths.results) == STDOUT
    summary.print(sys.stderr if is_piped else sys.stdout, outputs.locations(), notes)


def _check_complete(frames: Source, run: _Targets, summary: Summary) -> None:
    """Raise the error of a run that reached its end with parts missing."""
    summary.check_complete()
    if run.waiting:
        raise IncompleteError(
            f"{run.waiting[0].label} begins after the last frame that was read of {frames.name}: "
            "it was not tracked; give an earlier frame"
        )
    if frames.info.undecoded:
        raise StreamError(
            f"{frames.name}: {_undecoded(frames)}; the frames before and after them were tracked"
        )


def _undecoded(frames: Source) -> str:
    count = frames.info.undecoded
    return f"{count} frame{'s' * (count > 1)} could not be decoded and were skipped"
