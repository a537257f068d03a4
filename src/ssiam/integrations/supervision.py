"""Camera motion for supervision's zones, and for trackers of its detections that have none."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from ssiam.geometry import Image, Transform, map_box
from ssiam.integrations.host_motion import SceneMotion, SceneTransformation
from ssiam.motion import CameraMotion


class MotionEstimator(SceneMotion):
    """Makes the `coord_transform` of `LineZone.trigger` and `PolygonZone.trigger`.

    Threads: one thread at a time.
    """


class SceneTracker:
    """Gives a tracker detections in the scene, where the camera stands still.

    Threads: one thread at a time.

    Parameters
    ----------
    update : callable
        From `Detections` to `Detections`: ``ByteTrackTracker().update``.
    camera : CameraMotion, optional
        One that has not been used; ``CameraMotion()`` by default.
    """

    def __init__(self, update: Callable[[Any], Any], camera: CameraMotion | None = None) -> None:
        self._update, self._scene = update, SceneMotion(camera)

    def update(self, frame: Image, detections: Any) -> Any:
        """The tracker's `Detections`, with boxes in the frame. Boxes of nan are left out.

        Raises
        ------
        ArgumentError
            The frame is not a (H, W, 3) uint8 BGR image.
        """
        detections = detections[np.isfinite(detections.xyxy).all(axis=1)]
        moved: SceneTransformation = self._scene.update(frame, detections.xyxy)
        cur_from_scene = moved.homography_matrix
        scene_from_cur = np.asarray(np.linalg.inv(cur_from_scene), np.float64)
        return _mapped(cur_from_scene, self._update(_mapped(scene_from_cur, detections)))


def _mapped(to_from_from: Transform, detections: Any) -> Any:
    """A copy of detections with mapped boxes."""
    mapped = copy(detections)
    low, high = np.split(np.asarray(detections.xyxy, np.float64), 2, axis=1)
    xywh = [map_box(to_from_from, box) for box in np.hstack([low, high - low])]
    low, size = np.split(np.reshape(xywh, (-1, 4)), 2, axis=1)
    mapped.xyxy = np.hstack([low, low + size])
    return mapped
