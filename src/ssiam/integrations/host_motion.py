"""Camera motion for other people's trackers, which call the host here.

A host has its own loop. It hands over frames and the boxes of its detector, and takes whatever
comes back without checking it. So nothing that comes back is ever nan or impossible, and what
happens in streams (a change of the frame size, a gray camera, a box of nan) is no error.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.copying import DeepCopied
from ssiam.errors import ArgumentError
from ssiam.geometry import (
    IDENTITY,
    Image,
    Points,
    Transform,
    check_frame,
    frame_center,
    map_points,
)
from ssiam.motion import CameraMotion, Motion

_XYXY: Final = 4  # columns of a box; further ones (score, class) are ignored


class HostMotion(DeepCopied):
    """A `CameraMotion` that survives a host's loop.

    Threads: one thread at a time.

    Parameters
    ----------
    camera : CameraMotion, optional
        One that has not been used; ``CameraMotion()`` by default.
    """

    def __init__(self, camera: CameraMotion | None = None) -> None:
        self._unused = camera or CameraMotion()
        self.reset()

    def reset(self) -> None:
        """Start again: the next frame is the first one."""
        self._camera = deepcopy(self._unused)
        self._size_wh: tuple[int, int] | None = None
        self._boxes = np.empty((0, 4))

    def update(self, frame: Image, boxes: Any = None) -> Motion:
        """The motion from the last frame to this one.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR, or (H, W) or (H, W, 1) uint8 gray
            A frame of another size than the last one is a first frame.
        boxes : (N, 4 or more) array or sequence of such rows, optional
            left, top, right, bottom of the moving objects in this frame, pixels. They are excluded
            when the next frame is compared with this one. Those that are not finite or have no
            area are ignored.

        Returns
        -------
        Motion
            The identity where the motion cannot be estimated, and for the first frame.

        Raises
        ------
        ArgumentError
            The frame is not an image of this kind.
        """
        image, found = _without_channel(frame), finite_xywh(boxes)
        size_wh = check_frame(image, may_be_gray=True)
        if self._size_wh not in (None, size_wh):
            self.reset()
        motion = self._camera.update(image, self._boxes.tolist())
        self._size_wh, self._boxes = size_wh, found
        return motion

    def affine(self, frame: Image, boxes: Any = None) -> NDArray[np.float64]:
        """`update` as a (2, 3) transform of pixels; of a homography, the affine part at the center.

        Raises
        ------
        ArgumentError
            As `update`.
        """
        motion = self.update(frame, boxes)
        center = np.asarray(frame_center(motion.size_wh))
        matrix = motion.cur_from_prev / (motion.cur_from_prev[2] @ (*center, 1.0))
        moved = matrix[:2] @ (*center, 1.0)
        linear = matrix[:2, :2] - np.outer(moved, matrix[2, :2])
        return np.column_stack([linear, moved - linear @ center])


class SceneTransformation:
    """Between the scene (absolute, pixels of the first frame) and a frame (relative).

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    homography_matrix : (3, 3) float64
        Frame from scene.
    """

    def __init__(self, cur_from_scene: Transform) -> None:
        self.homography_matrix = cur_from_scene

    def abs_to_rel(self, points: ArrayLike) -> Points:
        """Map points (..., 2) of the scene into the frame."""
        return map_points(self.homography_matrix, points)

    def rel_to_abs(self, points: ArrayLike) -> Points:
        """Map points (..., 2) of the frame into the scene."""
        scene_from_cur = np.asarray(np.linalg.inv(self.homography_matrix), np.float64)
        return map_points(scene_from_cur, points)


class SceneMotion(DeepCopied):
    """The sum of all motions: where the scene of the first frame is now.

    Threads: one thread at a time.

    A frame that is a thousand frames away from the scene, or a change of the frame size, begins
    another scene.

    Parameters
    ----------
    camera : CameraMotion, optional
        As for `HostMotion`.
    """

    def __init__(self, camera: CameraMotion | None = None) -> None:
        self._motion = HostMotion(camera)
        self.reset()

    def reset(self) -> None:
        """Start again: the next frame is the first one of another scene."""
        self._motion.reset()
        self._cur_from_scene, self._size_wh = IDENTITY, (0, 0)

    def update(self, frame: Image, boxes: Any = None) -> SceneTransformation:
        """The transformation of this frame; arguments and errors as `HostMotion.update`."""
        motion = self._motion.update(frame, boxes)
        try:
            moved = motion.cur_from_prev @ self._cur_from_scene
            same_size = motion.size_wh == self._size_wh
            cur_from_scene = moved if same_size else IDENTITY
            checked = Motion.from_transform(cur_from_scene, motion.size_wh)
        except ArgumentError:
            checked = Motion.none(motion.size_wh)
        self._cur_from_scene, self._size_wh = checked.cur_from_prev, motion.size_wh
        return SceneTransformation(self._cur_from_scene)


def finite_xywh(boxes: Any) -> NDArray[np.float64]:
    """x, y, w, h (N, 4) of the rows left, top, right, bottom that are finite and have an area."""
    rows = [row[:_XYXY] for row in (() if boxes is None else boxes)]
    xyxy = np.array(rows, np.float64).reshape(-1, _XYXY)
    with np.errstate(invalid="ignore", over="ignore"):
        xywh = np.column_stack([xyxy[:, :2], xyxy[:, 2:] - xyxy[:, :2]])
    return xywh[np.isfinite(xywh).all(axis=1) & (xywh[:, 2:] > 0).all(axis=1)]


def _without_channel(frame: Image) -> Image:
    """A gray frame (H, W, 1) as (H, W)."""
    is_gray = isinstance(frame, np.ndarray) and frame.ndim == 3 and frame.shape[2] == 1
    return frame[..., 0] if is_gray else frame
