"""Camera motion for roboflow's trackers: ``tracker.cmc = CMC()``, and `MotionEstimator`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.integrations.host_motion import HostMotion, SceneMotion
from ssiam.motion import CameraMotion


class CMC:
    """In the place of `trackers.CMC`, in trackers made with ``enable_cmc=True``.

    Threads: one thread at a time.

    Parameters
    ----------
    camera : CameraMotion, optional
        One that has not been used; ``CameraMotion()`` by default.
    """

    def __init__(self, camera: CameraMotion | None = None) -> None:
        self._motion = HostMotion(camera)

    def estimate(self, frame_bgr: Image, dets_xyxy: Any = None) -> NDArray[np.float64]:
        """The (2, 3) transform of pixels from the last frame to this one.

        Parameters
        ----------
        frame_bgr : (H, W, 3) uint8 BGR
        dets_xyxy : (N, 4) array, optional
            left, top, right, bottom in this frame.

        Raises
        ------
        ArgumentError
            The frame is not an image of this kind.
        """
        return self._motion.affine(frame_bgr, dets_xyxy)

    def reset(self) -> None:
        """Start again, with another video."""
        self._motion.reset()


class MotionEstimator(SceneMotion):
    """In the place of `trackers.MotionEstimator`, for `MotionAwareTraceAnnotator`.

    Threads: one thread at a time.
    """
