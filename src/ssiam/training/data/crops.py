"""Template and search regions, their random variation, and the crops cut from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image, Transform, map_points
from ssiam.trackers.siamese import TargetState
from ssiam.training.data.batches import SEARCH_CROP, TEMPLATE_CROP
from ssiam.training.data.masks import Mask
from ssiam.training.data.settings import MAX_OFFSET, CropSettings

__all__ = [
    "CropRegion",
    "center_of",
    "crop_image",
    "crop_mask",
    "excludes",
    "random_background_region",
    "random_negative_region",
    "random_search_region",
    "random_template_region",
    "region_around",
]

# Range of the fraction of the way to a distractor by which a search region is shifted.
_TOWARDS: Final = (0.2, 1.0)
_CLEARANCE: Final = 8.0  # px between the search crop and a target that it must not show
_TRUNCATION: Final = 2.5  # standard deviations at which random scales and rotations are clipped


@dataclass(frozen=True)
class CropRegion:
    """A square of a frame, possibly rotated and stretched, that is cut as a crop.

    Attributes
    ----------
    center_xy : (float, float)
        Center of the region, px of the frame; the center of the first pixel is (0, 0).
    side : float
        Side of the square before it is stretched, px of the frame.
    out : int
        Side of the crop, px.
    stretch : float
        Factor by which the region's width is multiplied and its height divided.
    angle : float
        Rotation of the crop's content, radians.
    mirrored : bool
        Whether left and right are exchanged.
    """

    center_xy: tuple[float, float]
    side: float
    out: int
    stretch: float = 1.0
    angle: float = 0.0
    mirrored: bool = False

    @property
    def zooms(self) -> tuple[float, float]:
        """Px of the crop per px of the frame, horizontally and vertically."""
        zoom = self.out / self.side
        return zoom / self.stretch, zoom * self.stretch

    @property
    def crop_from_frame(self) -> Transform:
        """(3, 3) float64, px of the frame to px of the crop."""
        across, down = self.zooms
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        linear = np.diag((-across if self.mirrored else across, down))
        linear = linear @ np.array([[cos, -sin], [sin, cos]])
        matrix = np.eye(3)
        matrix[:2, :2] = linear
        matrix[:2, 2] = (self.out - 1) / 2 - linear @ self.center_xy
        return matrix

    def box_in_crop(self, xywh: XYWH) -> NDArray[np.float64]:
        """cx, cy, w, h (4,) of a box of the frame, px of the crop from its middle pixel."""
        crop_from_frame = self.crop_from_frame
        across, down = self.zooms
        center = crop_from_frame[:2, :2] @ np.subtract(center_of(xywh), self.center_xy)
        return np.array([*center, xywh[2] * across, xywh[3] * down])

    def mask_box_in_crop(self, mask: Mask) -> NDArray[np.float64]:
        """cx, cy, w, h (4,) of the bounding box of a non-empty mask (H, W) in the crop."""
        hull = cv2.convexHull(cv2.findNonZero(mask.astype(np.uint8)))[:, 0]
        points = (hull - np.array(self.center_xy)) @ self.crop_from_frame[:2, :2].T
        low, high = points.min(axis=0), points.max(axis=0)
        return np.concatenate([(low + high) / 2, high - low + self.zooms])

    def is_within(self, size_wh: tuple[int, int]) -> bool:
        """Whether the region is inside a frame of (width, height) px."""
        edge = self.out - 1
        corners = [(0, 0), (edge, 0), (edge, edge), (0, edge)]
        frame_from_crop = np.asarray(np.linalg.inv(self.crop_from_frame), dtype=np.float64)
        points = map_points(frame_from_crop, corners)
        return bool((points >= 0).all() and (points <= np.subtract(size_wh, 1)).all())

    def shifted(self, offset_xy: NDArray[np.float64]) -> CropRegion:
        """The region moved so that its center appears at (2,) px from the crop's middle."""
        frame_from_crop = np.linalg.inv(self.crop_from_frame[:2, :2])
        x, y = np.subtract(self.center_xy, frame_from_crop @ offset_xy).tolist()
        return replace(self, center_xy=(x, y))


def center_of(xywh: XYWH) -> tuple[float, float]:
    """The center of a box's pixels, (w - 1) / 2 from the first one."""
    return TargetState.from_xywh(xywh).center_xy


def region_around(xywh: XYWH, out: int) -> CropRegion:
    """The region centered on a box, for a crop of `out` px at the tracker's zoom.

    A crop of 127 px covers sqrt((w + c) (h + c)) px of the frame, with the context
    c = (w + h) / 2 (Bertinetto et al., SiamFC, ECCV Workshops 2016). Larger crops have the same
    zoom.
    """
    state = TargetState.from_xywh(xywh)
    return CropRegion(state.center_xy, state.context_side * out / TEMPLATE_CROP, out)


def excludes(region: CropRegion, xywh: XYWH, margin: float = _CLEARANCE) -> bool:
    """Whether a box is outside the crop by at least `margin` px of the crop."""
    cx, cy, w, h = region.box_in_crop(xywh)
    reach = region.out / 2 + margin
    return bool(abs(cx) - w / 2 >= reach or abs(cy) - h / 2 >= reach)


def random_template_region(
    xywh: XYWH, mirrored: bool, settings: CropSettings, rng: np.random.Generator
) -> CropRegion:
    """A varied template region around a box."""
    around = region_around(xywh, TEMPLATE_CROP)
    region = _varied(around, settings.template_scale, settings, rng)
    shift = rng.uniform(-settings.template_shift, settings.template_shift, 2)
    return replace(region, mirrored=mirrored).shifted(shift)


def random_search_region(
    xywh: XYWH,
    mirrored: bool,
    step_xy: NDArray[np.float64],
    settings: CropSettings,
    rng: np.random.Generator,
    *,
    any_angle: bool = False,
    towards_xy: NDArray[np.float64] | None = None,
) -> CropRegion:
    """A varied search region that contains the center of a box.

    Parameters
    ----------
    xywh : (float, float, float, float)
        The box, px of the frame.
    mirrored : bool
    step_xy : (2,) float64
        Motion of the target by camera shake since the last frame, px of the frame; added to the
        random shift.
    settings : CropSettings
    rng : Generator
    any_angle : bool
        Rotate by an arbitrary angle.
    towards_xy : (2,) float64, optional
        Vector from the target to a distractor, px of the frame. The region is shifted towards it,
        mostly by more than half of the distance.
    """
    far = rng.random() < settings.far
    scale = settings.scale * (2 if far else 1)
    region = _varied(region_around(xywh, SEARCH_CROP), scale, settings, rng)
    angle = rng.uniform(-np.pi, np.pi) if any_angle else region.angle
    region = replace(region, mirrored=mirrored, angle=angle)
    reach = MAX_OFFSET if far else settings.shift
    crop_from_frame = region.crop_from_frame[:2, :2]
    offset = rng.uniform(-reach, reach, 2) + crop_from_frame @ step_xy
    if towards_xy is not None:
        offset = offset / 4 - crop_from_frame @ towards_xy * rng.uniform(*_TOWARDS)
    return region.shifted(np.clip(offset, -MAX_OFFSET, MAX_OFFSET))


def random_negative_region(
    xywh: XYWH,
    size_wh: tuple[int, int],
    mirrored: bool,
    settings: CropSettings,
    rng: np.random.Generator,
) -> CropRegion | None:
    """A search region next to a box, which it does not show, at the zoom of the box.

    None if its center would be outside the frame of `size_wh` px.
    """
    region = _varied(region_around(xywh, SEARCH_CROP), settings.scale, settings, rng)
    region = replace(region, mirrored=mirrored)
    _, _, w, h = region.box_in_crop(xywh)
    min_distance = (SEARCH_CROP + max(w, h)) / 2 + _CLEARANCE
    angle, distance = rng.uniform(-np.pi, np.pi), min_distance * rng.uniform(1.0, 1.6)
    direction = np.array([np.cos(angle), np.sin(angle)])
    away = region.shifted(distance / np.abs(direction).max() * direction)
    (x, y), (width, height) = away.center_xy, size_wh
    inside = 0 <= x < width and 0 <= y < height
    return away if inside and excludes(away, xywh) else None


def random_background_region(size_wh: tuple[int, int], rng: np.random.Generator) -> CropRegion:
    """A search region inside an image of `size_wh` px."""
    side = min(size_wh) * rng.uniform(0.4, 1.0)
    x, y = (side / 2 - 0.5 + rng.random(2) * (np.array(size_wh) - side)).tolist()
    return CropRegion((x, y), side, SEARCH_CROP, mirrored=bool(rng.random() < 0.5))


def _varied(
    region: CropRegion, scale: float, settings: CropSettings, rng: np.random.Generator
) -> CropRegion:
    zoom, stretch, rotation = np.clip(rng.normal(size=3), -_TRUNCATION, _TRUNCATION)
    return replace(
        region,
        side=region.side * float(np.exp(scale * zoom)),
        stretch=float(np.exp(settings.stretch / 2 * stretch)),
        angle=float(np.deg2rad(settings.angle * rotation)),
    )


def crop_image(image: Image, region: CropRegion, background: Image | None = None) -> Image:
    """The crop (out, out, 3) uint8 of a region.

    Beyond the image border it is filled with the mean color, or with `background`, a crop
    (out, out, 3) uint8.
    """
    if background is None:
        return _warped(image, region, cv2.mean(image)[:3])
    crop = cv2.warpAffine(
        image,
        region.crop_from_frame[:2],
        (region.out, region.out),
        dst=background.copy(),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_TRANSPARENT,
    )
    return np.asarray(crop, dtype=np.uint8)


def crop_mask(mask: Mask, region: CropRegion) -> NDArray[np.uint8]:
    """Fraction of each pixel (out, out) uint8 of the crop that a mask covers, 0..255."""
    return _warped(mask.astype(np.uint8) * 255, region, (0.0,))


def _warped(
    image: NDArray[np.uint8], region: CropRegion, fill: Sequence[float]
) -> NDArray[np.uint8]:
    crop = cv2.warpAffine(
        image,
        region.crop_from_frame[:2],
        (region.out, region.out),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=fill,
    )
    return np.asarray(crop, dtype=np.uint8)
