"""Camera motion for norfair: give what `MotionEstimator.update` returns to `Tracker.update`."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.integrations.host_motion import SceneMotion, SceneTransformation
from ssiam.motion import CameraMotion


class MotionEstimator:
    """In the place of `norfair.camera_motion.MotionEstimator`.

    Threads: one thread at a time.

    Parameters
    ----------
    camera : CameraMotion, optional
        One that has not been used; ``CameraMotion()`` by default.
    """

    def __init__(self, camera: CameraMotion | None = None) -> None:
        self._scene = SceneMotion(camera)

    def update(self, frame: Image, mask: NDArray[np.uint8] | None = None) -> SceneTransformation:
        """The `CoordinatesTransformation` of a frame.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
        mask : (H, W) uint8, optional
            0 on moving objects, 1 elsewhere. Around each area of 0 a box is excluded.

        Raises
        ------
        ArgumentError
            The frame is not an image of this kind.
        """
        return self._scene.update(frame, None if mask is None else _boxes(mask))


def _boxes(mask: NDArray[np.uint8]) -> list[tuple[int, int, int, int]]:
    """left, top, right, bottom of each area of 0."""
    areas, _ = cv2.findContours(
        (mask == 0).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
    )
    sides = [cv2.boundingRect(area) for area in areas]
    return [(x, y, x + w, y + h) for x, y, w, h in sides]
