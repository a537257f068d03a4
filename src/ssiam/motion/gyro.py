"""`GyroTrack`: the rotation of a camera from a log of angular rates, beside or instead of images.

A gyro knows the rotation where images show nothing (dark, blurred, water), and for each row of a
rolling shutter. Its clock and axes are usually unknown: `synchronize` finds both from the video.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import permutations, product
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError
from ssiam.geometry import Image, finite_array, short_repr
from ssiam.motion.camera import CameraMotion
from ssiam.motion.motion import Motion, row_offsets

Floats = NDArray[np.float64]

_AXES: Final = "XYZ"
_MIN_FRAMES: Final = 10  # with a reliable motion, to synchronize
_MIN_TURN: Final = 1e-4  # rad/s, deviation of a rate that is not constant
_STEPS: Final = 4  # offsets per frame that are tried


@dataclass(frozen=True, eq=False)
class GyroTrack:
    """Angular rates of a camera over time.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    times_s : (N,) float64
        Increasing; seconds. The clock is that of the log, or of the video after `synchronize`.
    rates : (N, 3) float64
        Rotation of the camera about its axes x (right), y (down) and z (forward), rad/s; or about
        the axes of the sensor, before `synchronize`.

    Raises
    ------
    ArgumentError
        The arrays have other shapes, are not finite, or the times do not increase.
    """

    times_s: Floats
    rates: Floats
    _sums: Floats = field(init=False, repr=False)  # (N, 3) rotation since the first time

    def __post_init__(self) -> None:
        times, rates = finite_array(self.times_s), finite_array(self.rates)
        if times is None or times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0).all():
            raise ArgumentError(
                f"times_s is {short_repr(self.times_s)}: give at least two increasing times"
            )
        if rates is None or rates.shape != (len(times), 3):
            raise ArgumentError(
                f"rates is {short_repr(self.rates)}: give three rates (rad/s) for each time"
            )
        object.__setattr__(self, "times_s", times)
        object.__setattr__(self, "rates", rates)
        means = (rates[1:] + rates[:-1]) / 2 * np.diff(times)[:, None]
        object.__setattr__(self, "_sums", np.vstack([np.zeros(3), np.cumsum(means, axis=0)]))

    def oriented(self, orientation: str) -> GyroTrack:
        """The track about other axes.

        Parameters
        ----------
        orientation : str
            Which axis of this track is each new one, lower case for its opposite: with "YxZ" the
            new x is the old y, the new y the opposite of the old x.

        Raises
        ------
        ArgumentError
            It does not name each axis once.
        """
        if not isinstance(orientation, str) or sorted(orientation.upper()) != list(_AXES):
            raise ArgumentError(
                f"orientation is {short_repr(orientation)}: name each of X, Y and Z once"
            )
        order = [_AXES.index(letter.upper()) for letter in orientation]
        signs = [1.0 if letter.isupper() else -1.0 for letter in orientation]
        return GyroTrack(self.times_s, self.rates[:, order] * signs)

    def shifted(self, offset_s: float) -> GyroTrack:
        """The track with `offset_s` added to its times."""
        return GyroTrack(self.times_s + offset_s, self.rates)

    def covers(self, start_s: float, end_s: float) -> bool:
        """Whether the track has rates for all of this span."""
        return bool(self.times_s[0] <= start_s <= end_s <= self.times_s[-1])

    def turned(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Rotation vectors (..., 3) of the camera between two times, radians.

        They are sums of the rates, which is exact about one axis and good to a thousandth of a
        radian for the rotations between two frames. Outside of the track the camera is still.
        """
        ends = [
            np.stack([np.interp(time, self.times_s, axis) for axis in self._sums.T], axis=-1)
            for time in (np.asarray(start_s, np.float64), np.asarray(end_s, np.float64))
        ]
        return np.asarray(ends[1] - ends[0])

    def motion(
        self,
        start_s: float,
        end_s: float,
        focal_length: float,
        size_wh: tuple[int, int],
    ) -> Motion:
        """The motion of the image between two times; arguments and errors as `from_rotation`."""
        return Motion.from_rotation(-self.turned(start_s, end_s), focal_length, size_wh)

    def rows(
        self, time_s: float, readout_s: float, focal_length: float, size_wh: tuple[int, int]
    ) -> Floats:
        """As `Motion.rows`, from the rates during the readout of one frame.

        Parameters
        ----------
        time_s : float
            When the middle row is exposed.
        readout_s : float
            From the first row to the last one; negative if the last row is read first.
        focal_length : float
            Pixels.
        size_wh : (int, int)
            Width and height of the frames, pixels.

        Returns
        -------
        (H, 3, 3) float64
            middle_from_row: maps the pixels of each row to where they would be if all rows were
            exposed with the middle one.
        """
        height = size_wh[1]
        times = time_s + readout_s * row_offsets(height)
        vectors = -self.turned(times, np.full(height, time_s))
        found = [Motion.from_rotation(each, focal_length, size_wh) for each in vectors]
        return np.array([motion.cur_from_prev for motion in found])


@dataclass(frozen=True, eq=False)
class GyroSync:
    """A gyro track on the clock and axes of a video.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    track : GyroTrack
    offset_s : float
        What was added to the times of the log.
    orientation : str
        As for `GyroTrack.oriented`.
    focal_length : float
        Of the video, pixels.
    correlation : float
        -1..1, between the rates of the gyro and of the images. Below .5, do not trust it.
    """

    track: GyroTrack
    offset_s: float
    orientation: str
    focal_length: float
    correlation: float


def synchronize(
    track: GyroTrack,
    times_s: ArrayLike,
    motions: Sequence[Motion],
    *,
    max_offset_s: float = 10.0,
    orientation: str | None = None,
) -> GyroSync:
    """Find the clock, the axes and the focal length by which a gyro explains a video.

    The offset is the one with the highest correlation between the rotation rates of both, about
    all three axes; for each offset the best assignment of axes is used, unless it is given.

    Parameters
    ----------
    track : GyroTrack
        Of the log.
    times_s : (N,) array
        Time of each frame, seconds.
    motions : sequence of N Motion
        To each frame, from the one before it.
    max_offset_s : float
        Largest difference of the clocks.
    orientation : str, optional
        As for `GyroTrack.oriented`; all 48 are tried by default.

    Raises
    ------
    ArgumentError
        There are fewer than ten reliable motions, the camera does not turn, or the track and the
        video have no time in common.
    """
    times = finite_array(times_s)
    if times is None or times.shape != (len(motions),):
        raise ArgumentError("times_s and motions differ in length: give one time for each motion")
    tried = _orientations() if orientation is None else [orientation]
    for each in tried:
        track.oriented(each)
    used = [n for n in range(1, len(motions)) if motions[n].reliable and times[n] > times[n - 1]]
    if len(used) < _MIN_FRAMES:
        raise ArgumentError(
            f"{len(used)} motions are reliable: give at least {_MIN_FRAMES} to synchronize"
        )
    starts, ends = times[np.subtract(used, 1)], times[used]
    spans = (ends - starts)[:, None]
    seen = _image_rates([motions[n] for n in used], spans)  # of the camera, rad/s * focal length
    if seen.std(axis=0).max() < _MIN_TURN:
        raise ArgumentError("the camera does not turn: nothing to synchronize by")
    interval = float(np.median(spans)) / _STEPS
    count = int(max_offset_s / interval)
    offsets = interval * np.arange(-count, count + 1)

    def correlations(offset: float) -> Floats | None:
        """Correlation (3, 3) of the image's axes with the sensor's."""
        low, high = starts - offset, ends - offset
        inside = (low >= track.times_s[0]) & (high <= track.times_s[-1])
        if inside.sum() < _MIN_FRAMES:
            return None
        rates = track.turned(low[inside], high[inside]) / spans[inside]
        return _correlation(seen[inside], rates)

    best_score, best = -np.inf, (0.0, tried[0])
    scores = np.full(len(offsets), -np.inf)
    for index, offset in enumerate(offsets.tolist()):
        matrix = correlations(offset)
        if matrix is None:
            continue
        score, axes = max((_score(matrix, each), each) for each in tried)
        scores[index] = score
        if score > best_score:
            best_score, best = score, (offset, axes)
    if not np.isfinite(best_score):
        raise ArgumentError(
            "the gyro and the video have too little time in common: give a larger max_offset_s"
        )
    offset = best[0] + interval * _vertex(scores, int(np.argmax(scores)))
    synchronized = track.oriented(best[1]).shifted(offset)
    rates = synchronized.turned(starts, ends) / spans
    flat, turn = seen[:, :2].ravel(), rates[:, :2].ravel()
    focal_length = float(flat @ turn / max(float(turn @ turn), _MIN_TURN**2))
    return GyroSync(synchronized, offset, best[1], focal_length, float(best_score))


class GyroCameraMotion(DeepCopied):
    """A `CameraMotion` that a gyro replaces where the image is unreliable.

    Threads: one thread at a time for each object; several objects are independent.

    Parameters
    ----------
    camera : CameraMotion
        It must not be used by other code.
    track : GyroTrack
        On the clock and axes of the video, as from `synchronize`.
    focal_length : float
        Pixels.
    """

    def __init__(self, camera: CameraMotion, track: GyroTrack, focal_length: float) -> None:
        self._camera, self._track, self._focal_length = camera, track, focal_length
        self._last_s: float | None = None

    def update(self, frame: Image, time_s: float, exclude: Any = None) -> Motion:
        """The motion to the frame at `time_s`; arguments and errors as `CameraMotion.update`.

        Where the image is not reliable (black, blurred, without texture), the gyro's rotation, if
        it has rates for this span; after it, the next motion is from this frame on.
        """
        start, self._last_s = self._last_s, time_s
        motion = self._camera.update(frame, exclude)
        if motion.reliable or start is None or not self._track.covers(start, time_s):
            return motion
        size_wh = frame.shape[1], frame.shape[0]
        known = self._track.motion(start, time_s, self._focal_length, size_wh)
        return self._camera.update(frame, motion=known)


def _orientations() -> list[str]:
    """All assignments of axes, mirrored ones too: logs differ in the sense of their rates."""
    cases = [str.upper, str.lower]
    return [
        "".join(case(letter) for case, letter in zip(chosen, order, strict=True))
        for order in permutations(_AXES)
        for chosen in product(cases, repeat=3)
    ]


def _image_rates(motions: Sequence[Motion], spans: Floats) -> Floats:
    """Rates (N, 3) of the camera: about x and y times the focal length, px/s; about z, rad/s."""
    shifts = np.array([motion.shift_angle for motion in motions])
    dx, dy, angle = shifts.T
    return np.column_stack([dy, -dx, -angle]) / spans


def _correlation(first: Floats, second: Floats) -> Floats:
    """Correlation (3, 3) of each column of one array (N, 3) with each of another."""
    normed = []
    for array in (first, second):
        centered = array - array.mean(axis=0)
        normed.append(centered / np.maximum(np.linalg.norm(centered, axis=0), _MIN_TURN))
    return np.asarray(normed[0].T @ normed[1])


def _score(correlation: Floats, orientation: str) -> float:
    """Mean correlation over the axes of an orientation."""
    parts = [
        correlation[axis, _AXES.index(letter.upper())] * (1 if letter.isupper() else -1)
        for axis, letter in enumerate(orientation)
    ]
    return float(np.mean(parts))


def _vertex(scores: Floats, index: int) -> float:
    """Offset -.5..+.5 of the vertex of the parabola through the best score and its neighbors."""
    if not 0 < index < len(scores) - 1:
        return 0.0
    before, at, after = scores[index - 1 : index + 2]
    bend = before - 2 * at + after
    return float(0.5 * (before - after) / bend) if np.isfinite(bend) and bend < 0 else 0.0
