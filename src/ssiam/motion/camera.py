"""`CameraMotion`: frames in, the camera's motion out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Literal, Protocol, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.copying import CopiedWhole
from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import Image, check_frame, finite_array, shortened
from ssiam.motion.direct import DirectMotion
from ssiam.motion.fit import FitName
from ssiam.motion.keypoints import GeneratorName, KeypointGenerator
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion, known_motion
from ssiam.motion.points import PointMotion

KeypointName: TypeAlias = Literal["direct"] | GeneratorName
KEYPOINTS: tuple[KeypointName, ...] = ("direct", *get_args(GeneratorName))

_GROW: Final = 0.10  # of a box's size, added on each side: its edges move with it
_GROWN: Final = np.block(  # low xy, high xy from x, y, w, h
    [[np.eye(2), np.eye(2)], [-_GROW * np.eye(2), (1 + _GROW) * np.eye(2)]]
)


class _Estimator(Protocol):
    """Remembers one frame; tells the motion from it to the next."""

    def see(self, frame: Image) -> None: ...

    def motion(self, frame: Image, boxes: NDArray[np.float64]) -> Motion: ...


class CameraMotion(CopiedWhole):
    """Estimates the camera's motion from frame to frame, without delay.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Memory and time per frame do not grow with the stream.

    Parameters
    ----------
    keypoints : {"direct", "orb", "gftt", "harris", "brisk", "mser"}
        "direct" needs no keypoints: samples all over the picture, 320 pixels long, are aligned
        at once. It is the fastest and the most exact, and the surest under strong shake. The
        others are the paper's (Table 2; ORB is its choice): keypoints of the full-size picture,
        followed by Lucas-Kanade flow (eq. 1-4).
    fit : {"robust", "least_squares"}
        How a transform is fitted to keypoints; least squares is the printed form, and is drawn
        off by anything that moves by itself.
    model : {"similarity", "rigid", "affine", "homography"}
        What the camera may do: "rigid" (the paper's) turns and shifts, "similarity" also zooms,
        "affine" also shears, "homography" also tilts. `Motion.shift_angle` tells the rigid part.

    Examples
    --------
    >>> camera = CameraMotion()
    >>> for frame in frames:
    ...     motion = camera.update(frame)
    ...     background_now = ssiam.geometry.map_points(motion.cur_from_prev, background_before)
    """

    def __init__(
        self,
        keypoints: KeypointName = "direct",
        fit: FitName = "robust",
        model: ModelName = "similarity",
    ) -> None:
        self._keypoints: KeypointName = check_choice("keypoints", keypoints, KEYPOINTS)
        self._fit: FitName = check_choice("fit", fit, get_args(FitName))
        self._model: ModelName = check_choice("model", model, get_args(ModelName))
        self._size_wh: tuple[int, int] | None = None
        self._estimator: _Estimator | None = None

    def update(
        self,
        frame: Image,
        exclude: Sequence[float] | Sequence[Sequence[float]] | None = None,
        motion: Motion | ArrayLike | None = None,
    ) -> Motion:
        """Motion from the frame of the last call to this one.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR
        exclude : (x, y, w, h) or several of them, optional
            Boxes of things that move by themselves, the target first of all, where they were in
            the previous frame; raw-frame pixels. Nothing inside has a say.
        motion : Motion or (3, 3) or (2, 3) array, optional
            The motion if something else knows it, in place of the estimate: a gimbal's, a
            gyro's (`Motion.from_rotation`), a flight controller's. An array takes background
            points of the previous frame to this one, raw-frame pixels.

        Raises
        ------
        ValueError
            The frame is not (H, W, 3) uint8, or `exclude` or `motion` is not of its form.
        FrameSizeError
            The frame's size differs from the one before.
        """
        size_wh, boxes = check_frame(frame, self._size_wh), _boxes(exclude)
        known = None if motion is None else known_motion(motion, size_wh)
        estimator = self._estimator or self._made(size_wh)
        if known is None:
            known = estimator.motion(frame, boxes)
        else:
            estimator.see(frame)
        self._size_wh, self._estimator = size_wh, estimator
        return known

    def _made(self, size_wh: tuple[int, int]) -> _Estimator:
        if self._keypoints == "direct":
            return DirectMotion(size_wh, self._model)
        return PointMotion(size_wh, KeypointGenerator(self._keypoints), self._fit, self._model)


def _boxes(exclude: Any) -> NDArray[np.float64]:
    """Low xy, high xy (N, 4) of the boxes, grown a little."""
    boxes = np.empty((0, 4)) if exclude is None else finite_array(exclude)
    if boxes is None or (boxes.size and (boxes.ndim not in (1, 2) or boxes.shape[-1] != 4)):
        raise ArgumentError(
            f"exclude is {shortened(exclude)}: give (x, y, w, h) in pixels, or several"
        )
    grown: NDArray[np.float64] = boxes.reshape(-1, 4) @ _GROWN
    return grown
