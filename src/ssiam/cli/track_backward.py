"""`run_backward`: targets are tracked from a later frame to an earlier one.

The source is read three times: forward, to find the frames in which targets begin; backward, to
track; forward, to write the results in the order of the frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass

from ssiam.cli.moments import PlannedTarget
from ssiam.cli.track_outputs import Outputs
from ssiam.cli.track_progress import RunProgress
from ssiam.cli.track_records import TrackRecords, inverse_motion
from ssiam.cli.track_run import (
    TrackJob,
    check_complete,
    check_target_box,
    paired_frames,
    report_end,
    selected_frames,
)
from ssiam.cli.track_scan import SourceScan
from ssiam.cli.track_summary import Summary
from ssiam.cli.track_targets import TargetSet
from ssiam.cli.track_views import first_box, planned_views
from ssiam.errors import ArgumentError, StreamError
from ssiam.geometry import XYWH
from ssiam.motion import Motion
from ssiam.track import Track
from ssiam.video.frames import Frame
from ssiam.video.reversing import FrameRecord, check_reversible


def run_backward(
    job: TrackJob, targets: Sequence[PlannedTarget], progress: Sequence[RunProgress] = ()
) -> None:
    """Track `targets` backward from the frames in which they begin, and write the outputs.

    A target that begins at no given time begins in the last frame of the span. Frames after the
    last target's are read only if the span has an end. The parameters are those of `run_track`.

    Raises
    ------
    SsiamError
        As `run_track`, and if the source cannot be read several times. Nothing is written before
        all frames are tracked.
    """
    check_reversible(job.source.spec)
    scan = _scan(job, targets)
    with ExitStack() as stack:
        frames = stack.enter_context(job.source.open(sound=job.paths.video is not None))
        title = f"{frames.name} backward"
        summary = Summary(title, job.tracker.tracker, job.config.stabilize, len(targets))
        tracked = _track(job, targets, scan, summary, progress)
        outputs = Outputs(job.paths, job.config)
        stack.callback(lambda: report_end(job, frames, outputs, summary, progress))
        stack.enter_context(outputs)
        count = len(scan.records)
        views = planned_views(job.video, frames, scan.indexes, tracked.motion, tracked.first_box)
        outputs.open_video(frames, job.video, views)
        for done, frame in enumerate(selected_frames(frames, scan.span(), ()), 1):
            tracks = tracked.forward(frame.index)
            outputs.write(frame, tracks)
            outputs.write_video(frame, tracks, tracked.motion(frame.index))
            for each in progress:
                each.advance(count + done, 2 * count, summary.timer.fps)
    check_complete(frames, summary)
    if scan.fault is not None:
        raise scan.fault


@dataclass(kw_only=True)
class _Scan(SourceScan):
    """The first reading.

    Attributes
    ----------
    begins : list of int
        Index of the frame in which each target begins.
    """

    begins: list[int]


def _scan(job: TrackJob, targets: Sequence[PlannedTarget]) -> _Scan:
    """Read the source forward.

    Raises
    ------
    ArgumentError
        A box does not fit the frame, the span has no frame, or a target begins outside of it.
    """
    begins: dict[int, int] = {}
    records: list[FrameRecord] = []
    first = last = 0
    fault = None
    is_open_ended = job.span.end is None and all(each.begins is not None for each in targets)
    with job.source.open() as frames:
        for target in targets:
            check_target_box(target, frames.size_wh)
        job.static_areas.check(frames.size_wh)
        try:
            for frame in selected_frames(frames, job.span, targets):
                first, last = (first if records else frame.index), frame.index
                records.append(FrameRecord.of(frame))
                for index, target in enumerate(targets):
                    if target.begins is not None and target.begins.is_reached(frame):
                        begins.setdefault(index, frame.index)
                if is_open_ended and len(begins) == len(targets):
                    break
        except StreamError as error:
            fault = error
    for index, target in enumerate(targets):
        if target.begins is None:
            begins[index] = last
        elif index not in begins:
            raise ArgumentError(
                f"{target.label} begins after the last frame that was read of {frames.name}, "
                f"{last}: give a box of an earlier frame"
            )
    return _Scan(
        info=frames.info,
        first=first,
        records=records,
        fault=fault,
        begins=[begins[index] for index in range(len(targets))],
    )


def _track(
    job: TrackJob,
    targets: Sequence[PlannedTarget],
    scan: _Scan,
    summary: Summary,
    progress: Sequence[RunProgress],
) -> _BackwardTracks:
    """Track from the last frame of the span to the first."""
    reader = scan.reversed_frames(job.source)

    def has_begun(index: int, frame: Frame) -> bool:
        return frame.index <= scan.begins[index]

    run = TargetSet(job.new_group(), targets, has_begun)
    found = _BackwardTracks(len(targets))
    count = len(scan.records)
    camera = job.new_view_motion()
    for frame, following in paired_frames(iter(reader), count, job.tracker.threads):
        with summary.timer:
            if camera is not None and summary.frames:
                camera.start(frame)
            tracks = run.step(frame, following)
            motion = None if camera is None else camera.finish(frame, tracks)
        found.add(frame.index, tracks, motion)
        summary.add(frame.index, tracks)
        summary.add_failures(frame.index, run.failures)
        for each in progress:
            each.advance(scan.first + count - frame.index, 2 * count, summary.timer.fps)
    return found


class _BackwardTracks:
    """The tracks of all frames and, if the video needs it, the camera motion."""

    def __init__(self, targets: int) -> None:
        self._records = TrackRecords(targets)
        self._motions: dict[int, Motion] = {}  # from the frame after each

    def add(self, frame_index: int, tracks: Sequence[Track | None], motion: Motion | None) -> None:
        """Store the tracks of a frame, and the motion to it from the frame after it."""
        self._records.add(frame_index, tracks)
        if motion is not None:
            self._motions[frame_index] = motion

    def motion(self, frame_index: int) -> Motion | None:
        """Camera motion to a frame from the frame before it; None if it was not estimated."""
        return inverse_motion(self._motions.get(frame_index - 1))

    def first_box(self, frame_index: int) -> XYWH | None:
        """Box of the first target in a frame; None if it is lost or has not begun."""
        return first_box(self._records.tracks(frame_index))

    def forward(self, frame_index: int) -> list[Track | None]:
        """The tracks of a frame, with the camera motion since the frame before it."""
        before = self._records.tracks(frame_index - 1)
        return [
            None
            if track is None
            else track.with_changes(motion=inverse_motion(earlier.motion if earlier else None))
            for track, earlier in zip(self._records.tracks(frame_index), before, strict=True)
        ]
