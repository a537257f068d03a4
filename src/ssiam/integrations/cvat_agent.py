"""A tracking function for CVAT's agents: `create`, as cvat-cli calls it.

Form and names are those of `cvat_sdk.auto_annotation.TrackingFunction` (cvat-sdk 2.40 or later). Of
cvat-sdk, `TrackingFunctionSpec` and `TrackableShape` are used, and imported by `create`.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ssiam.errors import ArgumentError, MissingExtraError, check_choice
from ssiam.exchange.mask_shapes import cvat_mask, polygon
from ssiam.geometry import (
    XYWH,
    Image,
    Mask,
    corners_from_xywh,
    finite_array,
    short_repr,
    xywh_from_corners,
)
from ssiam.trackers import TRACKERS, StabilizedTracker, load_tracker

_SHAPES: Final = ("rectangle", "polygon", "mask")
_BOUNDS: Final = 4  # numbers after the run lengths of a mask: left, top, right, bottom


def create(
    tracker: str = "lite", weights: str | None = None, stabilize: str = "predict"
) -> CvatTrackingFunction:
    """Make the tracking function.

    ``cvat-cli function create-native`` and ``run-agent`` call it, with the options ``-p NAME=TYPE:
    VALUE``, if they are given ``--function-module ssiam.integrations.cvat_agent``.

    Parameters
    ----------
    tracker : str
        One of `ssiam.TRACKERS`; not a class of another package, since the name may come from a
        server's configuration.
    weights, stabilize
        As for `ssiam.load_tracker`.

    Raises
    ------
    MissingExtraError
        cvat-sdk is not installed, or has no tracking functions.
    ValueError, WeightsError
        As `ssiam.load_tracker`.
    """
    known = check_choice("tracker", tracker, TRACKERS)
    loaded = load_tracker(known, weights=weights, stabilize=stabilize)  # type: ignore[arg-type]
    return CvatTrackingFunction(loaded)


@dataclass
class TrackingState:
    """The state of one shape between two calls of `CvatTrackingFunction.track`.

    Threads: one thread at a time.

    Attributes
    ----------
    tracker : StabilizedTracker
        With the shape's target.
    kind : str
        "rectangle", "polygon" or "mask".
    """

    tracker: StabilizedTracker
    kind: str


class CvatTrackingFunction:
    """Tracks rectangles, polygons and masks through the frames that CVAT shows.

    Threads: one thread at a time for each state; several states at once.

    Polygons and masks are tracked by the upright box around them, and come back as the tracker's
    own mask; with a tracker that has no masks, as the rectangle of its box.

    Parameters
    ----------
    tracker : StabilizedTracker
        Prototype: each shape gets a clone.

    Raises
    ------
    MissingExtraError
        cvat-sdk is not installed, or has no tracking functions.
    """

    def __init__(self, tracker: StabilizedTracker) -> None:
        self._tracker = tracker
        self._sdk = _sdk()
        self._spec = self._sdk.TrackingFunctionSpec(supported_shape_types=_SHAPES)

    @property
    def spec(self) -> Any:
        """The `TrackingFunctionSpec`: which shapes are supported."""
        return self._spec

    def preprocess_image(self, context: Any, image: Any) -> Image:
        """The image (a `PIL.Image.Image`) as (H, W, 3) uint8 BGR."""
        return np.ascontiguousarray(np.asarray(image.convert("RGB"), np.uint8)[:, :, ::-1])

    def init_tracking_state(self, context: Any, pp_image: Image, shape: Any) -> TrackingState:
        """Take the object in a shape as the target.

        Parameters
        ----------
        context : TrackingFunctionShapeContext
            Not used.
        pp_image : (H, W, 3) uint8
            From `preprocess_image`.
        shape : TrackableShape
            `type` and `points` as in CVAT: x1, y1, x2, y2; or x, y of each corner; or run lengths
            and bounds of a mask.

        Raises
        ------
        ValueError
            The shape is of another kind, or its box does not fit the image.
        """
        tracker = self._tracker.clone()
        tracker.init(pp_image, box_of_shape(shape.type, shape.points))
        return TrackingState(tracker, shape.type)

    def track(self, context: Any, pp_image: Image, state: TrackingState) -> Any:
        """The shape in the next image (`TrackableShape`); None while the target is lost."""
        found = state.tracker.update(pp_image)
        if found.lost:
            return None
        height, width = pp_image.shape[:2]
        points = _points(state.kind, found.box, found.mask, (width, height))
        if points is None:
            return None
        return self._sdk.TrackableShape(type=state.kind, points=points)


def _sdk() -> Any:
    try:
        sdk = importlib.import_module("cvat_sdk.auto_annotation")
    except ImportError as error:
        raise MissingExtraError(
            f"a tracking function for CVAT needs its SDK ({error}): pip install 'cvat-sdk>=2.40'"
        ) from error
    if not hasattr(sdk, "TrackingFunctionSpec"):
        raise MissingExtraError(
            "this cvat-sdk has no tracking functions: pip install 'cvat-sdk>=2.40'"
        )
    return sdk


def box_of_shape(kind: str, points: Any) -> XYWH:
    """The upright box around a shape of CVAT, pixels.

    Parameters
    ----------
    kind : str
        `type` of the shape.
    points : sequence of float
        As for `CvatTrackingFunction.init_tracking_state`.

    Raises
    ------
    ArgumentError
        The shape is of another kind, or has other points.
    """
    if kind not in _SHAPES:
        raise ArgumentError(
            f"a {short_repr(kind)} cannot be tracked: draw a {', a '.join(_SHAPES)}"
        )
    numbers = finite_array(points)
    count = numbers.size if numbers is not None and numbers.ndim == 1 else 0
    fits = {"rectangle": count == _BOUNDS, "polygon": count >= 6 and count % 2 == 0}
    if numbers is None or not fits.get(kind, count >= _BOUNDS):
        raise ArgumentError(f"a {kind} of the points {short_repr(points)} cannot be tracked")
    if kind == "polygon":
        return xywh_from_corners(numbers.reshape(-1, 2))
    left, top, right, bottom = numbers[-_BOUNDS:].tolist()
    last = 1 if kind == "mask" else 0  # a mask's bounds are those of its last pixels
    return left, top, right + last - left, bottom + last - top


def _points(
    kind: str, xywh: XYWH, mask: Mask | None, size_wh: tuple[int, int]
) -> list[float] | None:
    """The points of a shape; None if it is outside of the image."""
    x, y, w, h = xywh
    if kind == "rectangle":
        return [x, y, x + w, y + h]
    pixels = mask if mask is not None and mask.any() else _box_mask(xywh, size_wh)
    if not pixels.any():
        return None
    if kind == "polygon":
        outline = polygon(pixels) or corners_from_xywh(xywh).tolist()
        return [float(value) for point in outline for value in point]
    part = cvat_mask(pixels)
    right, bottom = part.left + part.width - 1, part.top + part.height - 1
    return [float(value) for value in (*part.runs, part.left, part.top, right, bottom)]


def _box_mask(xywh: XYWH, size_wh: tuple[int, int]) -> Mask:
    width, height = size_wh
    x, y, w, h = xywh
    mask = np.zeros((height, width), np.bool_)
    top, left = max(round(y), 0), max(round(x), 0)
    mask[top : max(round(y + h), top), left : max(round(x + w), left)] = True
    return mask
