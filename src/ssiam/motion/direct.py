"""Camera motion by direct alignment of all pixels.

Keypoints cluster on the most textured object, and each is matched separately, by a few pixels.
Here, samples all over the frame are aligned jointly, by one transform: first at 80 pixels (see
`ssiam.motion.coarse`), then at 320 pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import Image, Transform
from ssiam.motion import kernel
from ssiam.motion.alignment import Alignment, AlignmentSettings, align
from ssiam.motion.cells import AnyTemplate, Floats, Grid
from ssiam.motion.coarse import CoarseEstimator
from ssiam.motion.flat_areas import flat_outside, is_blank, without_rim
from ssiam.motion.mesh import MeshEstimator
from ssiam.motion.models import ModelName, map_columns
from ssiam.motion.motion import Motion
from ssiam.motion.pyramid import Pyramid, PyramidBuilder

# Without an excluded box, all cells get equal weight and a tighter tolerance.
_WITH_EXCLUSION: Final = AlignmentSettings(
    noise=2.0, tolerance=0.3, evenness=0.3, max_iterations=4, min_step=5e-5
)
_WITHOUT_EXCLUSION: Final = replace(_WITH_EXCLUSION, evenness=1.0, tolerance=0.1)

_STRIDE: Final = 2  # px of the fine level between samples
_SIDE: Final = 8  # samples along each side of a cell
_EPSILON: Final = 1e-3

# A reliable motion
_MIN_EXPLAINED: Final = 0.25  # share of the texture (benchmarks/calibration/reliability.py)
_AGREEING: Final = 0.5  # explained share of the texture of a cell that agrees
_WELL_EXPLAINED: Final = 2 * _MIN_EXPLAINED  # below it, another coarse estimate is tried
_CLEARLY_MORE: Final = 1.5  # ratio of explained shares at which the later estimate is used
_MIN_AGREEING: Final = 8  # cells
_MIN_SPREAD: Final = 0.3  # units between the outermost agreeing cells along x or y

# Flat areas outside the scene
_MIN_SCENE: Final = 0.3  # share of the textured cells that must remain
_MAX_RIM: Final = 0.02  # share of a cell of the scene that the rim of a flat area may cover

# Overlays
_MOVED: Final = 1.0  # px of the fine level that a cell must move to count as evidence
_STATIC: Final = 0.25  # share of the texture by which a static cell may differ
_BETTER: Final = 0.5  # share of the error under the motion that the static error may reach
_CHANGED: Final = 0.5  # share of the texture; a cell that differs by more is not static
_GAIN: Final = 0.25  # weight of a frame's evidence
_OVERLAY: Final = 0.5  # evidence from which a cell is an overlay: three frames in a row


@dataclass(frozen=True, eq=False)
class _FrameData:
    """The data of a frame that is needed to align it with the next one."""

    pyramid: Pyramid
    coarse: AnyTemplate
    fine: AnyTemplate
    # (cells,) of `fine` and `coarse`: 0 for cells on a flat area outside the scene, else 1
    scene: Floats | None = None
    coarse_scene: Floats | None = None


class DirectMotion:
    """Camera motion of frames of one size, by direct alignment.

    Parameters
    ----------
    size_wh : (int, int)
        Width and height of the frames, pixels.
    model : {"rigid", "similarity", "affine", "homography"}
    mask : (H, W) uint8, optional
        255 at pixels that are not used, else 0.
    has_mesh : bool
        Whether reliable motions have a mesh.
    """

    def __init__(
        self,
        size_wh: tuple[int, int],
        model: ModelName,
        mask: Image | None = None,
        *,
        has_mesh: bool = False,
    ) -> None:
        kernel.report_absence()
        self._size_wh = size_wh
        self._builder = builder = PyramidBuilder(size_wh)
        self._coarse = CoarseEstimator(builder)
        self._grid = Grid(builder.fine_wh, builder.fine_from_unit, _STRIDE, _SIDE, model)
        self._overlays = OverlayDetector(self._grid)
        self._mesh: MeshEstimator | None = None
        self._too_small = self._coarse.grid.cells == 0
        self._used: Floats | None = None  # (cells,) 0 for cells under the mask, else 1
        self._coarse_used: Floats | None = None
        if mask is not None and not self._too_small:
            self._used = _unmasked(mask, self._grid, builder.fine_wh)
            self._coarse_used = _unmasked(mask, self._coarse.grid, builder.coarse_wh)
        if has_mesh and self._grid.cells:
            frame_from_fine = builder.frame_from_unit @ np.linalg.inv(builder.fine_from_unit)
            self._mesh = MeshEstimator(self._grid, frame_from_fine)
        self._prev: _FrameData | None = None
        self._spare: _FrameData | None = None  # its arrays are used for the next frame

    def set_previous(self, frame: Image) -> None:
        """Use a frame, (H, W, 3) or (H, W) uint8, as the previous one."""
        if not self._too_small:
            self._prev, self._spare = self._frame_data(frame), self._prev

    def estimate(self, frame: Image, boxes: NDArray[np.float64]) -> Motion:
        """The motion from the previous frame to this one, without the pixels in `boxes`.

        Boxes are (N, 4): low xy, high xy, pixels of the previous frame. Blank frames are skipped:
        the motion to the frame after them is that from the last frame that was not blank.
        """
        if self._too_small:
            return Motion.none(self._size_wh)
        cur, prev = self._frame_data(frame), self._prev
        if prev is None:
            self._prev = cur
            return Motion.none(self._size_wh, reliable=True)
        if is_blank(cur.pyramid.coarse):
            self._spare = cur
            return Motion.none(self._size_wh)
        self._prev, self._spare = cur, prev
        unit_boxes = self._builder.in_units(boxes)
        not_overlay = self._overlays.background
        background_share = self._grid.background_share(unit_boxes) * not_overlay
        scene = _product(prev.scene, self._used)
        if scene is not None:
            background_share *= scene
        settings = _WITH_EXCLUSION if len(boxes) else _WITHOUT_EXCLUSION
        best, best_aligned = Motion.none(self._size_wh), None
        for start in self._starts(prev, cur, unit_boxes):
            aligned = align(prev.fine, cur.pyramid.fine, start, background_share, settings)
            motion = self._checked(prev.fine, aligned, background_share)
            if motion.inliers > _CLEARLY_MORE * best.inliers:
                best, best_aligned = motion, aligned
            if best.inliers >= _WELL_EXPLAINED:
                break
        if best_aligned is None:
            return best
        cur_from_prev, error = best_aligned.cur_from_prev, best_aligned.error
        self._overlays.update(prev.fine, cur.fine, cur_from_prev, error)
        if self._mesh is None:
            return best
        to_fine = self._builder.fine_from_unit
        fine_cur_from_prev = to_fine @ cur_from_prev @ np.linalg.inv(to_fine)
        images = prev.pyramid.fine, cur.pyramid.fine
        mesh = self._mesh.estimate(*images, fine_cur_from_prev, background_share)
        return replace(best, mesh=mesh)

    def _starts(
        self, prev: _FrameData, cur: _FrameData, unit_boxes: NDArray[np.float64]
    ) -> Iterator[Transform]:
        """Coarse estimates, the likeliest first, one at a time.

        The second one converges under stronger shake. The third is for boxes that cover most of
        what has texture: it uses the texture in them. The fine alignment excludes the boxes from
        each.
        """
        attempts = [(unit_boxes, False), (unit_boxes, True)]
        if len(unit_boxes):
            attempts.append((unit_boxes[:0], True))
        not_overlay = self._overlays.background.reshape(self._grid.shape)
        scene = _product(prev.coarse_scene, self._coarse_used)
        for boxes, again in attempts:
            yield self._coarse.estimate(
                (prev.pyramid, prev.coarse),
                (cur.pyramid, cur.coarse),
                boxes,
                not_overlay,
                scene,
                again=again,
            )

    def _frame_data(self, frame: Image) -> _FrameData:
        """Pyramid and templates of a frame, with flat areas outside the scene filled."""
        spare = self._spare
        spare_levels, spare_fine, spare_coarse = (
            (None, None, None) if spare is None else (spare.pyramid, spare.fine, spare.coarse)
        )
        pyramid = self._builder.from_frame(frame, spare_levels)
        fine = self._grid.template(pyramid.fine, spare_fine)
        coarse_grid = self._coarse.grid
        outside = flat_outside(pyramid.fine)
        if outside is None:
            return _FrameData(pyramid, coarse_grid.template(pyramid.coarse, spare_coarse), fine)
        inside = without_rim(outside)
        scene = self._grid.mask_share(inside) >= 1 - _MAX_RIM
        if (scene & fine.textured).sum() < _MIN_SCENE * fine.textured.sum():
            return _FrameData(pyramid, coarse_grid.template(pyramid.coarse, spare_coarse), fine)
        filled = pyramid.fine.copy()
        filled[outside > 0] = round(cv2.mean(filled, inside)[0])
        pyramid = self._builder.from_fine(filled)
        coarse_inside = np.asarray(
            cv2.resize(inside, self._builder.coarse_wh, interpolation=cv2.INTER_AREA),
            dtype=np.uint8,
        )
        coarse_scene = coarse_grid.mask_share(coarse_inside) >= 1 - _MAX_RIM
        return _FrameData(
            pyramid,
            coarse_grid.template(pyramid.coarse, spare_coarse),
            fine,
            scene.astype(np.float32),
            coarse_scene.astype(np.float32),
        )

    def _checked(
        self, template: AnyTemplate, aligned: Alignment, background_share: Floats
    ) -> Motion:
        """The motion in pixels of the frame; not reliable if too little of the texture agrees."""
        weight = background_share * template.textured
        explained = weight * np.maximum(1 - aligned.error / (template.texture + _EPSILON), 0)
        share = float(explained.sum()) / max(float(weight.sum()), _EPSILON)
        x, y = self._grid.centers.compress(explained > _AGREEING, axis=1)
        builder = self._builder
        cur_from_prev = builder.frame_from_unit @ aligned.cur_from_prev @ builder.unit_from_frame
        motion = Motion(cur_from_prev, share, True, self._size_wh)
        reliable = (
            share >= _MIN_EXPLAINED
            and len(x) >= _MIN_AGREEING
            and max(x.max() - x.min(), y[-1] - y[0]) >= _MIN_SPREAD  # cells are in row order
        )
        return motion if reliable and motion.is_plausible else Motion.none(self._size_wh)


def _unmasked(mask: Image, grid: Grid, level_wh: tuple[int, int]) -> Floats:
    """(cells,) 0 for cells that a mask (H, W) of 0 and 255 touches, with its rim, else 1."""
    reduced = cv2.resize(mask, level_wh, interpolation=cv2.INTER_AREA)
    inside = without_rim(np.where(reduced > 0, 255, 0).astype(np.uint8))
    return (grid.mask_share(inside) >= 1 - _MAX_RIM).astype(np.float32)


def _product(first: Floats | None, second: Floats | None) -> Floats | None:
    """Product of two shares (cells,), of which None is 1."""
    if first is None or second is None:
        return second if first is None else first
    return np.asarray(first * second, dtype=np.float32)


class OverlayDetector:
    """Finds clocks, logos and crosshairs: cells that stay static while the scene moves.

    Attributes
    ----------
    background : (cells,) float32
        0 for cells with an overlay, else 1.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._evidence = np.zeros(grid.cells, dtype=np.float32)
        self.background: Floats = np.ones(grid.cells, dtype=np.float32)

    def update(
        self, prev: AnyTemplate, cur: AnyTemplate, cur_from_prev: Transform, error: Floats
    ) -> None:
        """Compare how well the camera motion and no motion explain each cell.

        Parameters
        ----------
        prev, cur : template
            The previous and the current frame.
        cur_from_prev : (3, 3) float64
            Units.
        error : (cells,) float32
            Error of each cell under that motion, gray levels squared.
        """
        static_error = prev.change_to(cur)
        static = static_error < np.minimum(_STATIC * prev.texture, _BETTER * error)
        static &= prev.textured
        if static.any():
            evidence = static & self._moved(cur_from_prev)
            self._evidence += np.where(evidence, _GAIN * (1 - self._evidence), 0)
        self._evidence[static_error > _CHANGED * prev.texture] = 0
        self.background = (self._evidence < _OVERLAY).astype(np.float32)

    def _moved(self, cur_from_prev: Transform) -> NDArray[np.bool_]:
        """Whether each cell (cells,) moved enough to distinguish an overlay from the scene."""
        centers = self._grid.centers
        shift = map_columns(cur_from_prev, centers) - centers
        return np.asarray(np.hypot(*shift) * self._grid.pixels_per_unit >= _MOVED)
