"""Evaluation protocols: supervised with restarts (VOT), one pass (OTB), real time."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Final, Literal, Protocol, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.errors import SourceError, check_choice
from ssiam.evaluation.measures.overlap import vot_overlap
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.runs.result_files import Experiment
from ssiam.geometry import Image, area_preserving_xywh
from ssiam.track import Track

ProtocolName: TypeAlias = Literal["vot", "ope", "realtime"]
PROTOCOLS: Final[tuple[ProtocolName, ...]] = get_args(ProtocolName)
EXPERIMENTS: Final[dict[ProtocolName, Experiment]] = {
    "vot": "baseline",
    "ope": "unsupervised",
    "realtime": "realtime",
}

_SKIP: Final = 5  # frames from a failure to the next start (VOT)
_REALTIME_FPS: Final = 20.0  # of vot-toolkit
_GRACE: Final = 3  # frames after a start that may be slow (vot-toolkit)


class Tracker(Protocol):
    """The interface of a tracker that a protocol runs; see `ssiam.load_tracker`."""

    def init(self, frame: Image, box: Sequence[float]) -> None:
        """Start on the target in `box`: x, y, w, h, or four corners; pixels."""

    def update(self, frame: Image) -> Track:
        """Track the target into the next frame."""


def run(tracker: Tracker, sequence: VideoSequence, protocol: ProtocolName = "vot") -> Trajectory:
    """Run a tracker over a sequence.

    Parameters
    ----------
    tracker : Tracker
    sequence : VideoSequence
    protocol : {"vot", "ope", "realtime"}
        "vot" restarts the tracker five frames after its overlap with the ground truth was 0; "ope"
        never restarts it; "realtime" is "vot" at 20 frames per second: a tracker that is too slow
        misses frames, in which its last result is repeated.

    Returns
    -------
    Trajectory
        Status, region and seconds of each frame; 0-based pixels.

    Raises
    ------
    SourceError
        A frame cannot be read, or there are fewer frames than ground truth.
    ValueError
        Unknown protocol.
    """
    check_choice("protocol", protocol, PROTOCOLS)
    if protocol == "realtime":
        tracker = RealtimeTracker(tracker, _REALTIME_FPS, _GRACE)
    count = len(sequence)
    status = np.full(count, Status.SKIPPED, dtype=np.int8)
    regions = np.full((count, 8), np.nan)
    seconds = np.zeros(count)
    start_from, tracking, frames = 0, False, 0
    for index, image in enumerate(sequence.images()):
        frames = index + 1
        if not tracking and (index < start_from or not _has_truth(sequence, index)):
            continue
        start = time.perf_counter()
        if not tracking:
            tracker.init(image, sequence.truth[index].tolist())
            status[index], tracking = Status.INITIALIZED, True
        else:
            regions[index] = _region_of(tracker.update(image))
            tracking = protocol == "ope" or not _lost(regions[index], sequence, index, image)
            found = Status.TRACKED if np.isfinite(regions[index, :4]).all() else Status.SKIPPED
            status[index] = found if tracking else Status.FAILED
        seconds[index] = time.perf_counter() - start
        if status[index] == Status.FAILED:
            regions[index], start_from = np.nan, index + _SKIP
    if frames < count:
        raise SourceError(f"sequence {sequence.name}: ends after {frames} of {count} frames")
    return Trajectory(status, _narrow(regions), seconds)


class RealtimeTracker:
    """A tracker that gets frames at a fixed rate and misses those that come while it is busy.

    Parameters
    ----------
    tracker : Tracker
    fps : float
        Frames per second.
    grace : int
        Number of slow frames after each start that do not delay the next ones.
    clock : callable
        Returns the time in seconds, from any origin.
    """

    def __init__(
        self,
        tracker: Tracker,
        fps: float,
        grace: int,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._tracker = tracker
        self._interval, self._grace, self._clock = 1 / fps, grace, clock
        self._late = 0.0
        self._grace_left = grace
        self._last: Track | None = None

    def init(self, frame: Image, box: Sequence[float]) -> None:
        """Start on the target in `box`: x, y, w, h, or four corners; pixels."""
        self._grace_left, self._late = self._grace, 0.0
        x, y, w, h = box if len(box) == 4 else area_preserving_xywh(box)
        self._last = Track((x, y, w, h))
        start = self._clock()
        self._tracker.init(frame, box)
        self._account(self._clock() - start)

    def update(self, frame: Image) -> Track:
        """The tracker's result, or its last one if it is still busy with an earlier frame."""
        if self._late > self._interval and self._last is not None:
            self._late -= self._interval
            return self._last
        start = self._clock()
        self._last = self._tracker.update(frame)
        self._account(self._clock() - start)
        return self._last

    def _account(self, seconds: float) -> None:
        if seconds <= self._interval:
            self._late = 0.0
        elif self._grace_left > 0:
            self._grace_left, self._late = self._grace_left - 1, 0.0
        else:
            self._late += seconds - self._interval


def _region_of(track: Track) -> NDArray[np.float64]:
    """Region (8,) of a track: its corners, or x, y, w, h and four nan if it has none."""
    if track.corners is not None:
        return np.asarray(track.corners, dtype=np.float64).reshape(8)
    return np.array([*track.box, *[np.nan] * 4])


def _has_truth(sequence: VideoSequence, index: int) -> bool:
    return index < len(sequence.truth) and bool(np.isfinite(sequence.truth[index]).all())


def _lost(region: NDArray[np.float64], sequence: VideoSequence, index: int, image: Image) -> bool:
    """Whether a region does not overlap the ground truth; False in frames without it."""
    if not _has_truth(sequence, index):
        return False
    height, width = image.shape[:2]
    overlap = vot_overlap(region[None], sequence.truth[index][None], (width, height))[0]
    return not overlap > 0


def _narrow(regions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Regions (N, 8) as (N, 4) if all of them are rectangles."""
    return regions[:, :4].copy() if np.isnan(regions[:, 4:]).all() else regions
