"""`Trajectory`: a run of a tracker on a sequence. `TrackedSequence`: a sequence with its runs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.datasets import VideoSequence
from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.regions import is_region


class Status(IntEnum):
    """State of a run in one frame; the codes of the VOT files, plus TRACKED."""

    SKIPPED = 0
    INITIALIZED = 1
    FAILED = 2
    TRACKED = 3


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One run of a tracker on one sequence.

    Attributes
    ----------
    status : (N,) int8
        A `Status` for every frame.
    regions : (N, 4) or (N, 8) float64
        x, y, w, h or the corners x1, y1, ... x4, y4; 0-based pixels, nan where the status is not
        TRACKED. In an array of 8 columns a row whose last four are nan is a rectangle.
    seconds : (N,) float64, optional
        Tracking time of each frame.

    Raises
    ------
    ArgumentError
        On construction: the arrays have wrong shapes, or different numbers of frames.
    """

    status: NDArray[np.int8]
    regions: NDArray[np.float64]
    seconds: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.regions.ndim != 2 or self.regions.shape[1] not in (4, 8):
            raise ArgumentError(
                f"regions of shape {self.regions.shape}: give an array (frames, 4) or (frames, 8)"
            )
        if self.status.shape != (len(self.regions),):
            raise ArgumentError(f"{self.status.size} statuses for {len(self.regions)} regions")
        if self.seconds is not None and self.seconds.shape != self.status.shape:
            raise ArgumentError(f"{self.seconds.size} times for {len(self.regions)} regions")

    def __len__(self) -> int:
        return len(self.status)

    @classmethod
    def from_regions(cls, regions: ArrayLike, seconds: ArrayLike | None = None) -> Trajectory:
        """A one-pass run from regions (N, 4) or (N, 8): TRACKED where a region is finite."""
        rows = np.asarray(regions, dtype=np.float64)
        known = is_region(rows)
        status = np.where(known, Status.TRACKED, Status.SKIPPED).astype(np.int8)
        times = None if seconds is None else np.asarray(seconds, dtype=np.float64)
        return cls(status, np.where(known[:, None], rows, np.nan), times)

    def first(self, count: int) -> Trajectory:
        """The run cut to its first `count` frames."""
        seconds = None if self.seconds is None else self.seconds[:count]
        return Trajectory(self.status[:count], self.regions[:count], seconds)

    @property
    def failures(self) -> NDArray[np.intp]:
        """Indices of the frames in which the target was lost."""
        return np.flatnonzero(self.status == Status.FAILED)

    @property
    def initializations(self) -> NDArray[np.intp]:
        """Indices of the frames in which the tracker was started."""
        return np.flatnonzero(self.status == Status.INITIALIZED)

    def burn_in(self, frames: int) -> NDArray[np.bool_]:
        """Mask (N,) bool of the first `frames` frames after each start, the start included."""
        mask = np.zeros(len(self), dtype=np.bool_)
        for start in self.initializations:
            mask[start : start + frames] = True
        return mask


@dataclass(frozen=True, eq=False)
class TrackedSequence:
    """A sequence and at least one run of a tracker, none longer than the ground truth."""

    sequence: VideoSequence
    runs: tuple[Trajectory, ...]

    @property
    def name(self) -> str:
        """Name of the sequence."""
        return self.sequence.name

    @property
    def size_wh(self) -> tuple[int, int]:
        """Width and height of the frames, pixels; `ArgumentError` if they are not known."""
        if self.sequence.size_wh is None:
            raise ArgumentError(
                f"sequence {self.name}: the size of the frames, which bounds the overlap, is not "
                "known: add the images, or width and height, to the dataset"
            )
        return self.sequence.size_wh

    @property
    def lost(self) -> float:
        """Number of lost targets, the mean over the runs."""
        return sum(len(run.failures) for run in self.runs) / len(self.runs)
