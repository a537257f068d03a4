"""Camera motion for the trackers of boxmot: ``tracker.cmc = CMC()``."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.integrations.host_motion import HostMotion
from ssiam.motion import CameraMotion

_ROTATED: Final = 5  # columns of rotated boxes: center x, y, width, height, angle


class CMC:
    """In the place of those of `boxmot.motion.cmc`.

    Threads: one thread at a time.

    Parameters
    ----------
    camera : CameraMotion, optional
        One that has not been used; ``CameraMotion()`` by default.
    """

    def __init__(self, camera: CameraMotion | None = None) -> None:
        self._motion = HostMotion(camera)

    def apply(self, img: Image, dets: NDArray[Any] | None = None) -> NDArray[np.float64]:
        """The (2, 3) transform of pixels from the last frame to this one.

        Parameters
        ----------
        img : (H, W, 3) uint8 BGR
        dets : (N, 4) or (N, 5) array, optional
            left, top, right, bottom; or center x, y, width, height, angle in radians.

        Raises
        ------
        ArgumentError
            The image is not of this kind.
        """
        is_rotated = dets is not None and np.shape(dets)[1:] == (_ROTATED,)
        return self._motion.affine(img, _around(np.asarray(dets)) if is_rotated else dets)

    def reset(self) -> None:
        """Start again, with another video."""
        self._motion.reset()


def _around(rotated: NDArray[Any]) -> NDArray[Any]:
    """The upright boxes around rotated ones."""
    cos, sin = np.abs(np.cos(rotated[:, 4:])), np.abs(np.sin(rotated[:, 4:]))
    half = (rotated[:, 2:4] * cos + rotated[:, 3:1:-1] * sin) / 2
    return np.hstack([rotated[:, :2] - half, rotated[:, :2] + half])
