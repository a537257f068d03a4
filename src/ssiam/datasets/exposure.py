"""`ShakingCamera`: the pictures that a moving camera takes, blurred and sheared as it moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from ssiam.datasets.camera_paths import CameraPath, Floats
from ssiam.geometry import Image, Points, Transform

# Pictures that a blurred one is the mean of.
_INSTANTS: Final = 11
# Rounds in which a point finds the row that sees it; each leaves the share of the picture's height
# that the camera goes during the readout.
_ROUNDS: Final = 25


@dataclass(frozen=True, eq=False)
class ShakingCamera:
    """A camera on a path, with an exposure that takes time and rows that are read in turn.

    Attributes
    ----------
    path : CameraPath
    size_wh : (int, int)
        Width and height of its pictures, pixels.
    exposure : float
        Share of the frame interval, 0 to 1, centred on the frame's time.
    readout : float
        Share of the frame interval from the first row to the last; the middle of the picture is
        read at the frame's time.
    """

    path: CameraPath
    size_wh: tuple[int, int]
    exposure: float = 0.0
    readout: float = 0.0

    def poses(self, times: Floats) -> Transform:
        """shaken_from_raw (..., 3, 3) at times (...) in frames: the mean over the exposure.

        The mean of the matrices takes a point to where the centroid of its blur is.
        """
        moments = times[..., None] + self._instants()
        return np.asarray(self.path.at(moments).mean(axis=-3))

    def poses_seeing(self, points: Points, frames: Floats) -> Transform:
        """shaken_from_raw (P, 3, 3) of the rows that see raw points (P, 2) in frames (P,)."""
        if self.readout == 0:
            return self.poses(frames)
        moments = frames[:, None] + self._instants()
        poses = self.path.at(moments)
        for _ in range(_ROUNDS):
            rows = np.einsum("pkj,pj->pk", poses[..., 1, :2], points) + poses[..., 1, 2]
            poses = self.path.at(moments + self._delays(rows))
        return np.asarray(poses.mean(axis=1))

    def picture(self, raw: Image, index: int) -> Image:
        """What the camera sees (H, W, 3) of the raw frame with that index."""
        times = index + self._instants()
        if len(times) == 1:
            return self._shot(raw, times[0])
        total = np.zeros((*self.size_wh[::-1], 3), dtype=np.float32)
        for time in times:
            cv2.accumulate(self._shot(raw, time), total)
        return np.rint(total / len(times)).astype(np.uint8)

    def _instants(self) -> Floats:
        if self.exposure == 0:
            return np.zeros(1)
        return self.exposure * ((np.arange(_INSTANTS) + 0.5) / _INSTANTS - 0.5)

    def _delays(self, rows: Floats) -> Floats:
        """When rows are read, in frames after the middle one."""
        height = self.size_wh[1]
        return self.readout * ((np.clip(rows, 0, height - 1) + 0.5) / height - 0.5)

    def _shot(self, raw: Image, time: float) -> Image:
        mirrored = cv2.BORDER_REFLECT_101
        if self.readout == 0:
            pose = self.path.at(time)[:2]
            return np.asarray(
                cv2.warpAffine(raw, pose, self.size_wh, borderMode=mirrored), dtype=np.uint8
            )
        x, y = self._raw_places(time)
        seen = cv2.remap(raw, x, y, cv2.INTER_LINEAR, borderMode=mirrored)
        return np.asarray(seen, dtype=np.uint8)

    def _raw_places(self, time: float) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float32]]]:
        """Raw x and y (H, W) of every pixel, each row seen from the pose at its own time."""
        width, height = self.size_wh
        columns, rows = np.arange(width), np.arange(height, dtype=np.float64)[:, None]
        raw_from_shaken = np.linalg.inv(self.path.at(time + self._delays(rows[:, 0])))
        return [
            (a * columns + b * rows + c).astype(np.float32)
            for a, b, c in (raw_from_shaken[:, axis, :, None].swapaxes(0, 1) for axis in (0, 1))
        ]
