"""`CameraMotion`: the camera motion from frame to frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from copy import deepcopy
from typing import Any, Final, Literal, Protocol, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssiam.copying import DeepCopied, NotPicklable
from ssiam.errors import ArgumentError, check_choice
from ssiam.geometry import Image, check_frame, finite_array, short_repr
from ssiam.motion.content import Area, ContentDetector
from ssiam.motion.direct import DirectMotion
from ssiam.motion.fit import FitName
from ssiam.motion.keypoints import GeneratorName, KeypointGenerator, KeypointMotion
from ssiam.motion.models import CameraModelName, ModelName
from ssiam.motion.motion import Motion, as_motion

KeypointName: TypeAlias = Literal["direct", GeneratorName]
MaskOf: TypeAlias = Callable[[tuple[int, int]], ArrayLike | None]
"""The static mask of frames of (width, height) pixels, or None without static pixels."""

MODELS: tuple[CameraModelName, ...] = get_args(CameraModelName)
KEYPOINTS: tuple[KeypointName, ...] = get_args(KeypointName)

_MARGIN: Final = 0.10  # share of a box's size added on each side: its edges move with the target
_LOW_HIGH_FROM_XYWH: Final = np.block(  # x, y, w, h to low xy, high xy of the enlarged box
    [[np.eye(2), np.eye(2)], [-_MARGIN * np.eye(2), (1 + _MARGIN) * np.eye(2)]]
)


class _Estimator(Protocol):
    """Keeps one frame, and estimates the motion from it to the next."""

    def set_previous(self, frame: Image) -> None: ...

    def estimate(self, frame: Image, boxes: NDArray[np.float64]) -> Motion: ...


class CameraMotion(DeepCopied):
    """Estimates the camera motion from frame to frame, without delay.

    Threads: one thread at a time for each object; several objects are independent.

    Memory and time per frame do not grow with the stream. Pillarbox and letterbox bars (9:16 or
    4:3 in 16:9, 2.35:1, of one color, blurred or patterned) are cropped first: the motion is that
    of the cropped video.

    Parameters
    ----------
    keypoints : {"direct", "orb", "gftt", "harris", "brisk", "mser"}
        "direct" aligns samples all over the frame, reduced to 320 pixels, without keypoints. It
        is the fastest, the most accurate and the most robust to strong shake. The others are the
        paper's (Table 2, which chooses ORB): keypoints of the full-size frame, tracked by
        Lucas-Kanade flow (eq. 1-4).
    fit : {"robust", "least_squares"}
        How a transform is fitted to keypoints; not used by "direct". Least squares is the printed
        form (eq. 3), and is biased by independently moving objects.
    model : {"similarity", "rigid", "affine", "homography", "mesh"}
        Degrees of freedom of the motion: "rigid" (the paper's) is rotation and shift;
        "similarity" adds zoom, "affine" shear, "homography" tilt. `Motion.shift_angle` is the
        rigid part. "mesh" is a homography and a mesh of shifts around it, for scenes with depth
        that the camera flies past: `Motion.at` is the motion at a point. For "direct" only.
    spread : bool
        Whether only the strongest keypoint of each of 16x12 cells is used; not used by "direct".
    mask : (H, W) bool or uint8, or callable, optional
        Set (not 0) where the frames show what moves with the camera, such as your vehicle or a
        display; raw-frame pixels. These pixels are not used. A callable makes it at the first
        frame, of (width, height).

    Raises
    ------
    ArgumentError
        A name is not one of the choices, `spread` is not True or False, `mask` is not such an
        array, or a mesh is asked for with keypoints.

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
        model: CameraModelName = "similarity",
        spread: bool = True,
        mask: ArrayLike | MaskOf | None = None,
    ) -> None:
        self._keypoints: KeypointName = check_choice("keypoints", keypoints, KEYPOINTS)
        self._fit: FitName = check_choice("fit", fit, get_args(FitName))
        self._model: CameraModelName = check_choice("model", model, MODELS)
        if not isinstance(spread, bool):
            raise ArgumentError(f"spread is {short_repr(spread)}: it must be True or False")
        self._spread = spread
        self._mask_of = mask if callable(mask) else None
        self._mask = None if mask is None or callable(mask) else _checked_mask(mask)
        if model == "mesh" and keypoints != "direct":
            raise ArgumentError(f'model "mesh" is given with keypoints {keypoints!r}: use "direct"')
        self._size_wh: tuple[int, int] | None = None
        self._content: ContentDetector | None = None
        self._estimator: _Estimator | None = None

    def __repr__(self) -> str:
        fit = "" if self._keypoints == "direct" else f", fit={self._fit!r}"
        return f"CameraMotion({self._keypoints!r}{fit}, model={self._model!r})"

    def update(
        self,
        frame: Image,
        exclude: Sequence[float] | Sequence[Sequence[float]] | None = None,
        motion: Motion | ArrayLike | None = None,
    ) -> Motion:
        """The motion from the frame of the last call to this one.

        Blank frames (black, white, of one color) are skipped: their motion is not reliable, and
        the motion of the next frame is that from the last frame that was not blank.

        Parameters
        ----------
        frame : (H, W, 3) uint8 BGR, or (H, W) uint8 gray
            The luma plane of a decoder is such a gray frame, of limited range too.
        exclude : (x, y, w, h) or several of them, optional
            Boxes of moving objects, such as the target, in the previous frame; raw-frame pixels.
            Pixels inside are not used.
        motion : Motion or (3, 3) or (2, 3) array, optional
            The motion, if it is known from a gimbal, a gyro (`Motion.from_rotation`) or a flight
            controller; it replaces the estimate. An array maps background points of the previous
            frame to this one, raw-frame pixels.

        Returns
        -------
        Motion
            The identity for the first frame.

        Raises
        ------
        ArgumentError
            The frame is not (H, W, 3) or (H, W) uint8, `exclude` or `motion` is not valid, or the
            mask has another size than the frame.
        FrameSizeError
            The frame has another size than the first one.
        """
        size_wh = check_frame(frame, self._size_wh, may_be_gray=True)
        boxes = _low_high_boxes(exclude)
        given = None if motion is None else as_motion(motion, size_wh)
        if self._content is None:
            self._mask = self._mask_for(size_wh)
            content = ContentDetector(size_wh)
            content.update(frame)
            self._estimator = self._new_estimator(frame, content.area)
            self._size_wh, self._content = size_wh, content
            return given or Motion.none(size_wh, reliable=True)
        return self._motion_within(self._content, frame, boxes, given)

    def _mask_for(self, size_wh: tuple[int, int]) -> Image | None:
        """The mask; `ArgumentError` if it has another size than the frames."""
        mask = self._mask
        if self._mask_of is not None:
            made = self._mask_of(size_wh)
            mask = None if made is None else _checked_mask(made)
        if mask is not None and mask.shape != size_wh[::-1]:
            height, width = mask.shape
            raise ArgumentError(
                f"the mask has {width}x{height} pixels: give one of {size_wh[0]}x{size_wh[1]}, as "
                "the frames have"
            )
        return mask

    def _motion_within(
        self,
        content: ContentDetector,
        frame: Image,
        boxes: NDArray[np.float64],
        given: Motion | None,
    ) -> Motion:
        """The motion to `frame`, estimated in the content of the previous frame."""
        estimator, area = self._estimator, content.area
        assert estimator is not None
        if given is not None:
            if content.update(frame):
                self._estimator = self._new_estimator(frame, content.area)
            else:
                estimator.set_previous(area.of(frame))
            return given
        origin_xy = area.left, area.top
        # First the estimate, which begins in the kernel: a thread beside it can run meanwhile.
        inner = estimator.estimate(area.of(frame), boxes - (*origin_xy, *origin_xy))
        motion = inner.uncropped(origin_xy, (frame.shape[1], frame.shape[0]))
        if content.update(frame):
            self._estimator = self._new_estimator(frame, content.area)
        # A homography may be possible in the content and not in the bars around it.
        if content.uncertain or not (motion is inner or motion.is_plausible):
            return Motion.none(motion.size_wh)
        return motion

    def _new_estimator(self, frame: Image, area: Area) -> _Estimator:
        """An estimator for this part of the frames; that of `frame` is its first previous one."""
        frame, mask = area.of(frame), None if self._mask is None else area.of(self._mask)
        size_wh = frame.shape[1], frame.shape[0]
        has_mesh = self._model == "mesh"
        model: ModelName = "homography" if self._model == "mesh" else self._model
        if self._keypoints == "direct":
            estimator: _Estimator = DirectMotion(size_wh, model, mask, has_mesh=has_mesh)
        else:
            generator = KeypointGenerator(self._keypoints)
            estimator = KeypointMotion(size_wh, generator, self._fit, model, self._spread, mask)
        estimator.set_previous(frame)
        return estimator


class PrefetchingCameraMotion(NotPicklable):
    """A `CameraMotion` that can process the next frame in another thread.

    Threads: one thread at a time for each object, which starts one worker thread; the frame given
    to `start` must not be written to before `update` has returned for it.

    The results are the same as those of the `CameraMotion`. The excluded boxes must be known when
    a frame is started.

    Parameters
    ----------
    camera : CameraMotion
        It must not be used by other code.

    Examples
    --------
    >>> camera = PrefetchingCameraMotion(CameraMotion())
    >>> camera.start(next_frame, exclude=box)
    >>> track = network(frame)
    >>> motion = camera.update(next_frame, exclude=box)
    """

    _copy_hint = "pickle its CameraMotion, or make one where it is needed"

    def __init__(self, camera: CameraMotion) -> None:
        self._camera = camera
        self._worker: ThreadPoolExecutor | None = None
        self._started: tuple[Image, Future[Motion]] | None = None

    def __deepcopy__(self, memo: dict[int, Any]) -> PrefetchingCameraMotion:
        if self._started is not None:
            self._started[1].exception()  # waits: the worker changes the camera until then
        copied = memo[id(self)] = PrefetchingCameraMotion(deepcopy(self._camera, memo))
        copied._started = self._started  # the copy expects the same frame
        return copied

    def start(
        self, frame: Image, exclude: Any = None, then: Callable[[Image], None] | None = None
    ) -> None:
        """Start estimating the motion to `frame`, which must be the next one given to `update`.

        Until then the frame must not be written to, and no other frame may be started. `then` is
        called with the frame in the worker thread, before `update` returns its motion.

        Raises
        ------
        ArgumentError
            Another frame was started before.
        """
        if self._started is not None:
            raise ArgumentError("another frame was started before: call update with it first")
        self._worker = self._worker or ThreadPoolExecutor(1, "camera-motion")
        self._started = frame, self._worker.submit(self._process, frame, exclude, then)

    def update(
        self, frame: Image, exclude: Any = None, motion: Motion | ArrayLike | None = None
    ) -> Motion:
        """The motion to `frame`, as from `CameraMotion.update`; waits for it if it was started.

        For a started frame, `exclude` is that of `start`, and a given `motion` replaces the result.

        Raises
        ------
        ArgumentError
            Another frame was started and not yet updated; or as `CameraMotion.update`.
        """
        if self._started is None:
            return self._camera.update(frame, exclude, motion)
        started, estimate = self._started
        if started is not frame:
            raise ArgumentError(
                "another frame was started as the next one: call update with that frame first"
            )
        given = None if motion is None else as_motion(motion, check_frame(frame, may_be_gray=True))
        self._started = None
        estimated = estimate.result()
        return given or estimated

    def _process(self, frame: Image, exclude: Any, then: Callable[[Image], None] | None) -> Motion:
        motion = self._camera.update(frame, exclude)
        if then is not None:
            then(frame)
        return motion


def _checked_mask(mask: Any) -> Image:
    """A mask (H, W) of 0 and 255."""
    array = np.asarray(mask) if isinstance(mask, np.ndarray | list | tuple) else np.empty(0)
    if array.ndim != 2 or not array.size or array.dtype not in (np.bool_, np.uint8):
        raise ArgumentError(
            f"mask is {short_repr(mask)}: give a (height, width) array of bool or uint8, set where "
            "the frames are static"
        )
    return np.where(array, 255, 0).astype(np.uint8)


def _low_high_boxes(exclude: Any) -> NDArray[np.float64]:
    """Low xy, high xy (N, 4) of boxes x, y, w, h, enlarged by the margin."""
    boxes = np.empty((0, 4)) if exclude is None else finite_array(exclude)
    if boxes is None or (boxes.size and (boxes.ndim not in (1, 2) or boxes.shape[-1] != 4)):
        raise ArgumentError(
            f"exclude is {short_repr(exclude)}: give (x, y, w, h) in pixels, or several"
        )
    enlarged: NDArray[np.float64] = boxes.reshape(-1, 4) @ _LOW_HIGH_FROM_XYWH
    return enlarged
