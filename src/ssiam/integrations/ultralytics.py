"""Camera motion for the trackers of ultralytics: `GMC`, and a callback that installs it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image
from ssiam.integrations.host_motion import HostMotion
from ssiam.motion import CameraMotion


class GMC:
    """In the place of `ultralytics.trackers.utils.gmc.GMC`: ``tracker.gmc = GMC()``.

    Threads: one thread at a time.

    Parameters
    ----------
    camera : CameraMotion, optional
        One that has not been used; ``CameraMotion()`` by default.
    """

    method = "ssiam"  # trackers do not call a GMC whose method is None

    def __init__(self, camera: CameraMotion | None = None) -> None:
        self._motion = HostMotion(camera)

    def apply(self, raw_frame: Image, detections: Any = None) -> NDArray[np.float64]:
        """The (2, 3) transform of pixels from the last frame to this one.

        Parameters
        ----------
        raw_frame : (H, W, 3) uint8 BGR
        detections : (N, 4) array or list of (4,) arrays, optional
            left, top, right, bottom in this frame.

        Raises
        ------
        ArgumentError
            The frame is not an image of this kind.
        """
        return self._motion.affine(raw_frame, detections)

    def reset_params(self) -> None:
        """Start again, with another video."""
        self._motion.reset()


def install(predictor: Any) -> None:
    """Give each tracker of a predictor that compensates camera motion a `GMC`.

    ``model.add_callback("on_predict_batch_start", install)``, before ``model.track``.
    """
    for tracker in getattr(predictor, "trackers", ()):
        if not isinstance(getattr(tracker, "gmc", None), GMC | None):
            tracker.gmc = GMC()
