"""`run_corrected`: targets are tracked between keyframes that a person has corrected.

The source is read forward and backward, to track from every keyframe to the next one and to the one
before it; forward again, for the masks in the blended boxes, if the tracker has a network for them;
and forward, to write the results. `ssiam.exchange.blending` blends the two runs,
`ssiam.exchange.mask_edges` adds the masks' edges.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np

from ssiam.cli.track_outputs import Outputs
from ssiam.cli.track_progress import RunProgress
from ssiam.cli.track_records import StoredTrack
from ssiam.cli.track_run import (
    TrackJob,
    check_complete,
    report_end,
    selected_frames,
)
from ssiam.cli.track_scan import SourceScan
from ssiam.cli.track_summary import Summary
from ssiam.cli.track_views import first_box, planned_views
from ssiam.errors import ArgumentError, StreamError
from ssiam.exchange.annotations import NO_BOX
from ssiam.exchange.blending import (
    SETTLING_UPDATES,
    Blend,
    Keyframe,
    Run,
    Section,
    blend,
    sections,
)
from ssiam.exchange.doubts import Doubt, doubtful_frames
from ssiam.exchange.mask_edges import with_mask_edges
from ssiam.geometry import XYWH, check_box
from ssiam.motion import Motion
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker, TrackerGroup
from ssiam.trackers.box_mask import BOUNDS_THRESHOLDS, BoxMask
from ssiam.video import Frame
from ssiam.video.results import STDOUT
from ssiam.video.reversing import FrameRecord

_UNKNOWN_END: Final = 10**9  # of a source, before it has been read once
_MOST_DOUBTS: Final = 8  # lines about frames to look at
_LEAST_SIDE: Final = 1.0  # px, of boxes whose outlines are scaled

_Stored: TypeAlias = dict[int, StoredTrack]  # by frame


def run_corrected(
    job: TrackJob,
    keyframes: Sequence[Sequence[Keyframe]],
    progress: Sequence[RunProgress] = (),
) -> list[str]:
    """Track each target from its keyframes, and write the outputs.

    Parameters
    ----------
    job : TrackJob
        Its source can be read several times (`check_reversible`).
    keyframes : sequence of sequence of Keyframe
        Of each target, at least one with a box.
    progress : sequence of RunProgress

    Returns
    -------
    list of str
        A line for each frame that a person should look at, the most doubtful first.

    Raises
    ------
    SsiamError
        As `run_track`, and if a keyframe does not fit the source. Nothing is written before all
        frames are tracked.
    """
    with ExitStack() as stack:
        frames = stack.enter_context(job.source.open(sound=job.paths.video is not None))
        for number, own in enumerate(keyframes, 1):
            for each in own:
                _check_keyframe(each, number, frames.size_wh)
        job.static_areas.check(frames.size_wh)
        title = f"{frames.name} between keyframes"
        summary = Summary(title, job.tracker.tracker, job.config.stabilize, len(keyframes))
        scan = _track_forward(job, keyframes, summary, progress)
        count = len(scan.records)
        targets = [
            _CorrectedTarget(own, scan, number, backward)
            for (number, own), backward in zip(
                enumerate(keyframes, 1),
                _track_backward(job, keyframes, scan, summary, progress),
                strict=True,
            )
        ]
        if scan.box_mask is not None:
            _measure_masks(job, scan, scan.box_mask, targets, summary, progress)
        outputs = Outputs(job.paths, job.config)
        doubts = sorted(
            (each for target in targets for each in target.doubts()),
            key=lambda each: -each.doubt,
        )
        lines = [
            f"look here: frame {each.frame}, target {each.target}: {each.reason}"
            for each in doubts[:_MOST_DOUBTS]
        ]
        if not job.quiet:
            file = sys.stderr if str(job.paths.results) == STDOUT else sys.stdout
            for line in lines:
                stack.callback(print, f"  {line}", file=file)
        stack.callback(lambda: report_end(job, frames, outputs, summary, progress))
        stack.enter_context(outputs)
        views = planned_views(
            job.video,
            frames,
            scan.indexes,
            scan.view_motions.get,
            lambda index: first_box([targets[0].track(index)]),
        )
        outputs.open_video(frames, job.video, views)
        for done, frame in enumerate(selected_frames(frames, scan.span(), ()), 1):
            tracks = [target.track(frame.index) for target in targets]
            outputs.write(frame, tracks)
            outputs.write_video(frame, tracks, scan.view_motions.get(frame.index))
            summary.add(frame.index, tracks)
            for report in progress:
                report.advance(
                    (scan.passes - 1) * count + done, scan.passes * count, summary.timer.fps
                )
    check_complete(frames, summary)
    if scan.fault is not None:
        raise scan.fault
    return lines


@dataclass(kw_only=True)
class _Scan(SourceScan):
    """The first reading.

    Attributes
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    runs : list of dict
        Tracks of the forward runs of each target, by the frames of their keyframes.
    motions : dict of int to Motion or None
        Camera motion to each frame.
    view_motions : dict of int to Motion
        Camera motion to each frame, for the video; empty if that needs none.
    box_mask : BoxMask or None
        The tracker's network for masks.
    """

    size_wh: tuple[int, int]
    runs: list[dict[int, _Stored]]
    motions: dict[int, Motion | None] = field(default_factory=dict)
    view_motions: dict[int, Motion] = field(default_factory=dict)
    box_mask: BoxMask | None = None

    @property
    def passes(self) -> int:
        """How often the source is read."""
        return 3 if self.box_mask is None else 4

    def sections(self, keyframes: Sequence[Keyframe], number: int) -> list[Section]:
        """The sections of a target; raises `ArgumentError` as `sections`, with its number."""
        return _sections(keyframes, number, self.indexes.start, self.indexes.stop - 1)


def _check_keyframe(keyframe: Keyframe, number: int, size_wh: tuple[int, int]) -> None:
    if keyframe.xywh is None:
        return
    try:
        check_box(keyframe.xywh, size_wh)
    except ArgumentError as error:
        raise ArgumentError(f"target {number}, frame {keyframe.frame}: {error}") from None


def _sections(keyframes: Sequence[Keyframe], number: int, first: int, last: int) -> list[Section]:
    try:
        return sections(keyframes, first, last)
    except ArgumentError as error:
        raise ArgumentError(f"target {number}: {error}") from None


@dataclass
class _PlannedRun:
    """A run that starts on a keyframe.

    Attributes
    ----------
    name : str
        Of its target, in messages.
    xywh : (x, y, w, h)
        Box of the keyframe.
    last : int
        Frame after which it ends.
    found : dict of int to StoredTrack
        Tracks by frame. That of the keyframe is the tracker's own box there.
    """

    name: str
    xywh: XYWH
    last: int
    found: _Stored


class _RunSet:
    """Runs that start and end in different frames of one pass over the source.

    Parameters
    ----------
    group : TrackerGroup
        Without targets.
    planned : dict of int to list of _PlannedRun
        By the frame in which they start.

    Attributes
    ----------
    motion : Motion or None
        Camera motion to the last frame; None for the first.
    failures : dict of str to Exception
        What failed in the last frame, by name.
    """

    def __init__(self, group: TrackerGroup, planned: dict[int, list[_PlannedRun]]) -> None:
        self._group = group
        self._planned = planned
        self._has_frame = False
        self._running: list[tuple[StabilizedTracker, _PlannedRun]] = []
        self.motion: Motion | None = None
        self.failures: dict[str, Exception] = {}

    def step(self, frame: Frame) -> list[Track]:
        """Track in the next frame; end the runs that end in it, and start those that start.

        Returns the tracks of the runs in this frame.
        """
        found: list[Track] = []
        if self._has_frame:
            tracks = self._group.update(frame.image)
            self.motion, self.failures = self._group.motion, self._named_failures()
            found += tracks
            for (_, run), track in zip(self._running, tracks, strict=True):
                run.found[frame.index] = StoredTrack.of(track)
        else:
            self._group.init(frame.image, [])
            self._has_frame = True
        for tracker, run in list(self._running):
            if run.last == frame.index:
                self._group.leave(tracker)
                self._running.remove((tracker, run))
        for run in self._planned.get(frame.index, ()):
            tracker = self._group.new_tracker()
            tracker.init(frame.image, run.xywh)
            for _ in range(SETTLING_UPDATES):
                track = tracker.update(frame.image)
            found.append(track)
            run.found[frame.index] = StoredTrack.of(track)
            if run.last != frame.index:
                self._group.join(tracker, track.box)
                self._running.append((tracker, run))
        return found

    def _named_failures(self) -> dict[str, Exception]:
        failed = {
            self._running[position][1].name: error
            for position, error in self._group.failures.items()
        }
        if self._group.camera_failure is not None:
            failed["camera"] = self._group.camera_failure
        return failed


def _planned(
    keyframes: Sequence[Sequence[Keyframe]],
    runs: list[dict[int, _Stored]],
    first: int,
    last: int,
    ends: Callable[[Section], dict[int, int]],
) -> dict[int, list[_PlannedRun]]:
    """The runs of all targets, whose tracks go to `runs`; `ends` gives their last frames."""
    planned: dict[int, list[_PlannedRun]] = {}
    for number, own in enumerate(keyframes, 1):
        boxes = {each.frame: each.xywh for each in own}
        for section in _sections(own, number, first, last):
            for frame, end in ends(section).items():
                xywh = boxes[frame]
                assert xywh is not None
                found = runs[number - 1].setdefault(frame, {})
                run = _PlannedRun(f"target {number}", xywh, end, found)
                planned.setdefault(frame, []).append(run)
    return planned


def _track_forward(
    job: TrackJob,
    keyframes: Sequence[Sequence[Keyframe]],
    summary: Summary,
    progress: Sequence[RunProgress],
) -> _Scan:
    """Track forward from every keyframe to the next one."""
    with job.source.open() as frames:
        scan = _Scan(info=frames.info, size_wh=frames.size_wh, runs=[{} for _ in keyframes])
        runs: _RunSet | None = None
        camera = job.new_view_motion()
        try:
            for frame in selected_frames(frames, job.span, ()):
                if runs is None:
                    scan.first = frame.index
                    ends = _planned(
                        keyframes, scan.runs, frame.index, _UNKNOWN_END, Section.forward_ends
                    )
                    group = job.new_group()
                    scan.box_mask = group.new_tracker().view_tracker.box_mask
                    runs = _RunSet(group, ends)
                scan.records.append(FrameRecord.of(frame))
                with summary.timer:
                    if camera is not None:
                        camera.start(frame)
                    tracks = runs.step(frame)
                    if camera is not None:
                        scan.view_motions[frame.index] = camera.finish(frame, tracks)
                scan.motions[frame.index] = runs.motion
                summary.add_failures(frame.index, runs.failures)
                total = None if frames.length is None else scan.passes * frames.length
                for each in progress:
                    each.advance(len(scan.records), total, summary.timer.fps)
        except StreamError as error:
            scan.fault = error
    return scan


def _track_backward(
    job: TrackJob,
    keyframes: Sequence[Sequence[Keyframe]],
    scan: _Scan,
    summary: Summary,
    progress: Sequence[RunProgress],
) -> list[dict[int, _Stored]]:
    """Track backward from every keyframe to the one before it; as `_Scan.runs`."""
    found: list[dict[int, _Stored]] = [{} for _ in keyframes]
    first, last = scan.indexes.start, scan.indexes.stop - 1
    planned = _planned(keyframes, found, first, last, Section.backward_ends)
    runs = _RunSet(job.new_group(), planned)
    count = len(scan.records)
    for done, frame in enumerate(scan.reversed_frames(job.source), 1):
        with summary.timer:
            runs.step(frame)
        summary.add_failures(frame.index, runs.failures)
        for each in progress:
            each.advance(count + done, scan.passes * count, summary.timer.fps)
    return found


def _measure_masks(
    job: TrackJob,
    scan: _Scan,
    box_mask: BoxMask,
    targets: Sequence[_CorrectedTarget],
    summary: Summary,
    progress: Sequence[RunProgress],
) -> None:
    """Put the edges of the masks in the targets' boxes into their tracks."""
    count = len(scan.records)
    with job.source.open() as frames:
        for done, frame in enumerate(selected_frames(frames, scan.span(), ()), 1):
            with summary.timer:
                for target in targets:
                    target.measure_mask(box_mask, frame)
            for each in progress:
                each.advance(2 * count + done, scan.passes * count, summary.timer.fps)
    for target in targets:
        target.use_masks()


class _CorrectedTarget:
    """The blended tracks of one target.

    Parameters
    ----------
    keyframes : sequence of Keyframe
    scan : _Scan
        After the forward pass.
    number : int
        Of the target, from 1.
    backward : dict of int to dict of int to StoredTrack
        Tracks of the backward runs, by the frames of their keyframes.
    """

    def __init__(
        self,
        keyframes: Sequence[Keyframe],
        scan: _Scan,
        number: int,
        backward: dict[int, _Stored],
    ) -> None:
        self._given = {each.frame for each in keyframes}
        self._forward, self._backward = scan.runs[number - 1], backward
        self._scan = scan
        self._number = number
        self._blends: list[tuple[Section, Blend]] = []
        for section in scan.sections(keyframes, number):
            ahead = {f: _run(self._forward[f], 1) for f in section.forward_ends()}
            back = {f: _run(self._backward[f], -1) for f in section.backward_ends()}
            self._blends.append((section, blend(section, ahead, back)))
        self._bounds = [
            np.full((len(track.boxes), len(BOUNDS_THRESHOLDS), 4), np.nan)
            for _, track in self._blends
        ]

    def measure_mask(self, box_mask: BoxMask, frame: Frame) -> None:
        """Keep the bounds of the mask in the target's box in a frame."""
        for (section, track), bounds in zip(self._blends, self._bounds, strict=True):
            if section.first <= frame.index <= section.last:
                position = frame.index - section.first
                x, y, w, h = track.boxes[position].tolist()
                bounds[position] = box_mask.bounds(FrameView(frame.image, border=0), (x, y, w, h))

    def use_masks(self) -> None:
        """Put the edges of the masks that were measured into the tracks."""
        self._blends = [
            (section, with_mask_edges(section, track, bounds))
            for (section, track), bounds in zip(self._blends, self._bounds, strict=True)
        ]

    def doubts(self) -> list[Doubt]:
        """The frames that a person should look at."""
        return [
            each
            for section, track in self._blends
            for each in doubtful_frames(section, track, self._number)
        ]

    def track(self, index: int) -> Track:
        """The track in a frame."""
        motion = self._scan.motions[index]
        for section, found in self._blends:
            if section.first <= index <= section.last:
                return self._blended(section, found, index).with_changes(motion=motion)
        is_given = index in self._given
        return Track(NO_BOX, score=0.0, lost=True, motion=motion, keyframe=is_given)

    def _blended(self, section: Section, found: Blend, index: int) -> Track:
        """The track of a frame, with the outline of the run that has the larger weight there."""
        position = index - section.first
        x, y, w, h = found.boxes[position].tolist()
        is_given = index in self._given
        nearest = self._nearest(section, index, is_backward=found.backward_share[position] > 0.5)
        return _moved(nearest.track(), (x, y, w, h), self._scan.size_wh).with_changes(
            score=float(found.scores[position]), lost=bool(found.lost[position]), keyframe=is_given
        )

    def _nearest(self, section: Section, index: int, *, is_backward: bool) -> StoredTrack:
        frames = [each.frame for each in section.keyframes]
        if is_backward:
            start = min(frame for frame in frames if frame >= index)
            return self._backward[start][index]
        return self._forward[max(frame for frame in frames if frame <= index)][index]


def _run(stored: _Stored, direction: int) -> Run:
    """The boxes of a run in the order in which it has met the frames."""
    tracks = [stored[frame].plain for frame in sorted(stored, key=lambda f: direction * f)]
    return Run(
        np.array([track.box for track in tracks], dtype=np.float64),
        np.array([track.score for track in tracks], dtype=np.float64),
        np.array([track.lost for track in tracks], dtype=np.bool_),
    )


def _moved(track: Track, xywh: XYWH, size_wh: tuple[int, int]) -> Track:
    """The track with another box; its outline is moved and scaled with the box."""
    x, y, w, h = track.box
    across, down = xywh[2] / max(w, _LEAST_SIDE), xywh[3] / max(h, _LEAST_SIDE)
    moved = np.array(
        [[across, 0.0, xywh[0] - across * x], [0.0, down, xywh[1] - down * y], [0.0, 0.0, 1.0]]
    )
    return track.mapped(moved, size_wh).with_changes(box=xywh)
