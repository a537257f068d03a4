"""A clip of a walking target before a shaking camera, as it would be recorded, and its views."""

from __future__ import annotations

from typing import Any

import numpy as np

from ssiam.datasets import Shake
from ssiam.datasets.shake import camera_path
from ssiam.geometry import XYWH, map_box, map_point
from ssiam.motion import Motion
from ssiam.render.locked import LockedViews, locked_views
from ssiam.render.locked_config import LockedConfig

SIZE_WH = 640, 360
COUNT = 150


class LockedClip:
    """A target that walks through a scene before a shaking camera; its boxes are exact."""

    def __init__(self, strength: float = 0.03, target_wh: tuple[float, float] = (30, 60)) -> None:
        self.poses = poses = camera_path(Shake(strength), COUNT, SIZE_WH)
        steps = poses[1:] @ np.linalg.inv(poses[:-1])
        self.motions = [Motion.from_transform(each, SIZE_WH) for each in (np.eye(3), *steps)]
        w, h = target_wh
        x = 220 + 1.2 * np.arange(COUNT)
        y = 180 + 20 * np.sin(np.arange(COUNT) / 25)
        self.boxes: list[XYWH | None] = [
            map_box(pose, (float(x[i]) - w / 2, float(y[i]) - h / 2, w, h))
            for i, pose in enumerate(poses)
        ]
        self.truth = list(self.boxes)

    def views(self, **settings: Any) -> LockedViews:
        return locked_views(self.motions, self.boxes, LockedConfig(**settings))

    def target_xy(self, views: LockedViews) -> np.ndarray:
        """Center of the target in the output, in shares of its width and height."""
        centers = [
            map_point(matrix, x + w / 2, y + h / 2)
            for matrix, (x, y, w, h) in zip(views.out_from_raw, self.truth, strict=True)  # type: ignore[misc]
        ]
        return (np.array(centers) + 0.5) / views.size_wh

    def camera_xy(self, views: LockedViews) -> np.ndarray:
        """Center of the view in the scene, which is the frame without shake."""
        middle = (np.array(views.size_wh) - 1) / 2
        matrices = np.linalg.inv(views.out_from_raw @ self.poses)
        return np.array([map_point(matrix, *middle) for matrix in matrices])


def widths(views: LockedViews) -> np.ndarray:
    """Width of each view, raw pixels."""
    return views.size_wh[0] / np.sqrt(np.linalg.det(views.out_from_raw[:, :2, :2]))


def outside(views: LockedViews) -> float:
    """The largest distance of a corner of a view from the frame, raw pixels."""
    w, h = views.size_wh
    corners = np.array([[-0.5, w - 0.5, w - 0.5, -0.5], [-0.5, -0.5, h - 0.5, h - 0.5], [1] * 4])
    raw = (np.linalg.inv(views.out_from_raw) @ corners)[:, :2]
    low, high = -0.5 - raw, raw - np.array(SIZE_WH)[:, None] + 0.5
    return float(np.maximum(low, high).max())


def border(views: LockedViews) -> float:
    """Share of the output's pixels that are outside of the frame."""
    w, h = views.size_wh
    x, y = np.meshgrid((np.arange(40) + 0.5) / 40 * w - 0.5, (np.arange(40) + 0.5) / 40 * h - 0.5)
    points = np.stack([x.ravel(), y.ravel(), np.ones(1600)])
    raw = (np.linalg.inv(views.out_from_raw) @ points)[:, :2]
    beyond = (raw < -0.5) | (raw > np.array(SIZE_WH)[:, None] - 0.5)
    return float(beyond.any(axis=1).mean())
