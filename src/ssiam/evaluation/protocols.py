"""How a tracker is run over a sequence: supervised (VOT), one pass (OTB), against the clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Final, Literal, Protocol, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.errors import SourceError, check_choice
from ssiam.evaluation.layouts import Experiment
from ssiam.evaluation.overlap import vot_overlap
from ssiam.evaluation.trajectory import Status, Trajectory
from ssiam.geometry import Image
from ssiam.track import Track

ProtocolName: TypeAlias = Literal["vot", "ope", "realtime"]
PROTOCOLS: Final[tuple[ProtocolName, ...]] = get_args(ProtocolName)
EXPERIMENTS: Final[dict[ProtocolName, Experiment]] = {
    "vot": "baseline",
    "ope": "unsupervised",
    "realtime": "realtime",
}

_SKIP: Final = 5  # frames from a failure to the next start
_REALTIME_FPS: Final = 20.0  # as vot-toolkit has it
_GRACE: Final = 3  # slow frames after a start that cost nothing


class Tracker(Protocol):
    """What is run: see `ssiam.load_tracker`."""

    def init(self, frame: Image, box: Sequence[float]) -> None:
        """Start on the target in `box`, x, y, w, h."""

    def update(self, frame: Image) -> Track:
        """The target in the next frame."""


def run(tracker: Tracker, sequence: VideoSequence, protocol: ProtocolName = "vot") -> Trajectory:
    """One run of a tracker over a sequence.

    Parameters
    ----------
    tracker : Tracker
    sequence : VideoSequence
    protocol : {"vot", "ope", "realtime"}
        "vot" starts again five frames after the overlap with the truth was 0; "ope" never does;
        "realtime" is "vot" at 20 frames a second: while the tracker is late, it misses frames,
        and its last answer stands.

    Raises
    ------
    SourceError
        A frame cannot be read, or there are fewer frames than the truth tells.
    ValueError
        Unknown protocol.
    """
    check_choice("protocol", protocol, PROTOCOLS)
    clocked = Clocked(tracker, _REALTIME_FPS, _GRACE) if protocol == "realtime" else tracker
    count = len(sequence)
    status = np.full(count, Status.SKIPPED, dtype=np.int8)
    regions = np.full((count, 8), np.nan)
    seconds = np.zeros(count)
    start_from, tracking, seen = 0, False, 0
    for index, image in enumerate(sequence.images()):
        seen = index + 1
        if not tracking and (index < start_from or not _known(sequence, index)):
            continue
        began = time.perf_counter()
        if not tracking:
            clocked.init(image, sequence.box(index))
            status[index], tracking = Status.INITIALIZED, True
        else:
            regions[index] = region_of(clocked.update(image))
            tracking = protocol == "ope" or not _lost(regions[index], sequence, index, image)
            told = Status.TRACKED if np.isfinite(regions[index, :4]).all() else Status.SKIPPED
            status[index] = told if tracking else Status.FAILED
        seconds[index] = time.perf_counter() - began
        if status[index] == Status.FAILED:
            regions[index], start_from = np.nan, index + _SKIP
    if seen < count:
        raise SourceError(f"sequence {sequence.name}: ends after {seen} of {count} frames")
    return Trajectory(status, _narrowed(regions), seconds)


class Clocked:
    """A tracker that gets frames at a fixed rate, whether it is done with the last one or not.

    Parameters
    ----------
    tracker : Tracker
    fps : float
        Frames a second.
    grace : int
        Frames after each start that may be slow.
    clock : callable
        Seconds.
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
        self._left = grace
        self._last: Track | None = None

    def init(self, frame: Image, box: Sequence[float]) -> None:
        """Start on a target."""
        self._left, self._late = self._grace, 0.0
        x, y, w, h = box
        self._last = Track((x, y, w, h))
        began = self._clock()
        self._tracker.init(frame, box)
        self._account(self._clock() - began)

    def update(self, frame: Image) -> Track:
        """The tracker's answer, or its last one if it has no time for this frame."""
        if self._late > self._interval and self._last is not None:
            self._late -= self._interval
            return self._last
        began = self._clock()
        self._last = self._tracker.update(frame)
        self._account(self._clock() - began)
        return self._last

    def _account(self, took: float) -> None:
        if took <= self._interval:
            self._late = 0.0
        elif self._left > 0:
            self._left, self._late = self._left - 1, 0.0
        else:
            self._late += took - self._interval


def region_of(track: Track) -> NDArray[np.float64]:
    """What a track says, (8,): its corners if it has any, else x, y, w, h and four times nan."""
    if track.corners is not None:
        return np.asarray(track.corners, dtype=np.float64).reshape(8)
    return np.array([*track.box, *[np.nan] * 4])


def _known(sequence: VideoSequence, index: int) -> bool:
    return index < len(sequence.truth) and bool(np.isfinite(sequence.truth[index]).all())


def _lost(region: NDArray[np.float64], sequence: VideoSequence, index: int, image: Image) -> bool:
    """Whether a region has nothing of the truth; where the truth is not told, it is not lost."""
    if not _known(sequence, index):
        return False
    height, width = image.shape[:2]
    overlap = vot_overlap(region[None], sequence.truth[index][None], (width, height))[0]
    return not overlap > 0


def _narrowed(regions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Regions (N, 8) as (N, 4) if all are rectangles."""
    return regions[:, :4].copy() if np.isnan(regions[:, 4:]).all() else regions
