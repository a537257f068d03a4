"""`CameraMotion`: frames in, the camera's motion out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from copy import deepcopy
from typing import Any, Final, Literal, Protocol, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.copying import DeepCopied, NotPicklable
from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import Image, check_frame, finite_array, short_repr
from ssiam.motion.content import Content
from ssiam.motion.direct import DirectMotion
from ssiam.motion.fit import FitName
from ssiam.motion.keypoints import GeneratorName, KeypointGenerator, PointMotion
from ssiam.motion.models import ModelName
from ssiam.motion.motion import Motion, known_motion

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


class CameraMotion(DeepCopied):
    """Estimates the camera's motion from frame to frame, without delay.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Memory and time per frame do not grow with the stream. Bars beside the scene (9:16 or 4:3 in
    16:9, 2.35:1, of one color or blurred) are cut off first: the motion is that of the cut video.

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
        self._content: Content | None = None
        self._estimator: _Estimator | None = None

    def update(
        self,
        frame: Image,
        exclude: Sequence[float] | Sequence[Sequence[float]] | None = None,
        motion: Motion | ArrayLike | None = None,
    ) -> Motion:
        """Motion from the frame of the last call to this one.

        Frames that show nothing (black, white, of one color) are passed over: their motion is not
        reliable, and that of the frame after them is from the last one that showed something.

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
        if self._content is None:
            content = Content(size_wh)
            content.update(frame)
            self._estimator = self._begun(content.area.of(frame))
            self._size_wh, self._content = size_wh, content
            return known or Motion.none(size_wh, reliable=True)
        return self._between(self._content, frame, boxes, known)

    def _between(
        self, content: Content, frame: Image, boxes: NDArray[np.float64], motion: Motion | None
    ) -> Motion:
        """The motion to `frame`, estimated in what shows the scene in both frames."""
        estimator, area = self._estimator, content.area
        assert estimator is not None
        changed = content.update(frame)
        if motion is None:
            origin = area.left, area.top
            found = estimator.motion(area.of(frame), boxes - 2 * origin)
            motion = found.placed(origin, (frame.shape[1], frame.shape[0]))
            if content.doubtful:
                motion = Motion.none(motion.size_wh)
        elif not changed:
            estimator.see(area.of(frame))
        if changed:
            self._estimator = self._begun(content.area.of(frame))
        return motion

    def _begun(self, shown: Image) -> _Estimator:
        """An estimator for frames of this size, of which it has seen this one."""
        size_wh = shown.shape[1], shown.shape[0]
        if self._keypoints == "direct":
            estimator: _Estimator = DirectMotion(size_wh, self._model)
        else:
            generate = KeypointGenerator(self._keypoints)
            estimator = PointMotion(size_wh, generate, self._fit, self._model)
        estimator.see(shown)
        return estimator


def _boxes(exclude: Any) -> NDArray[np.float64]:
    """Low xy, high xy (N, 4) of the boxes, grown a little."""
    boxes = np.empty((0, 4)) if exclude is None else finite_array(exclude)
    if boxes is None or (boxes.size and (boxes.ndim not in (1, 2) or boxes.shape[-1] != 4)):
        raise ArgumentError(
            f"exclude is {short_repr(exclude)}: give (x, y, w, h) in pixels, or several"
        )
    grown: NDArray[np.float64] = boxes.reshape(-1, 4) @ _GROWN
    return grown


class MotionAhead(NotPicklable):
    """A `CameraMotion` that can be set to work on a frame before its motion is asked for.

    Threads: one thread at a time for each object, with one more of its own; the frame given to
    `start` must not be written to before `update` has returned for it.

    Networks leave a core free where there are two. What is left out of the estimate must be
    known when the work starts; the results are those of the camera alone.

    Parameters
    ----------
    camera : CameraMotion

    Examples
    --------
    >>> ahead = MotionAhead(CameraMotion())
    >>> ahead.start(next_frame, exclude=box)
    >>> track = network(frame)
    >>> motion = ahead.update(next_frame, exclude=box)
    """

    _copy_hint = "pickle its CameraMotion, or make one where it is needed"

    def __init__(self, camera: CameraMotion) -> None:
        self._camera = camera
        self._worker: ThreadPoolExecutor | None = None
        self._begun: tuple[Image, Future[Motion]] | None = None

    def __deepcopy__(self, memo: dict[int, Any]) -> MotionAhead:
        if self._begun is not None:
            self._begun[1].exception()  # waits: the camera is at work until then
        copied = memo[id(self)] = MotionAhead(deepcopy(self._camera, memo))
        copied._begun = self._begun  # the same frame is waited for
        return copied

    def start(self, frame: Image, exclude: Any = None) -> None:
        """Begin with the motion to `frame`, which must be the next one given to `update`.

        Until then the frame must not be written to. Another one may not be begun before.
        """
        if self._begun is not None:
            raise ArgumentError("a frame is announced already: give it to update first")
        self._worker = self._worker or ThreadPoolExecutor(1, "camera-motion")
        self._begun = frame, self._worker.submit(self._camera.update, frame, exclude)

    def update(
        self, frame: Image, exclude: Any = None, motion: Motion | ArrayLike | None = None
    ) -> Motion:
        """Motion to `frame`, as `CameraMotion.update`; waited for if it was begun.

        Raises
        ------
        ValueError
            Another frame was begun, and is still waited for; or as `CameraMotion.update`.
        """
        if self._begun is None:
            return self._camera.update(frame, exclude, motion)
        begun, found = self._begun
        if begun is not frame:
            raise ArgumentError(
                "this is not the frame that was announced as the next one: give that one first"
            )
        known = None if motion is None else known_motion(motion, check_frame(frame))
        self._begun = None
        estimated = found.result()
        return known or estimated
