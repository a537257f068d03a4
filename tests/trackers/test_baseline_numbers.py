"""The numbers of the confidence evidence: the running baseline and the cells of a box."""

import numpy as np
import pytest

from helpers.synthetic import world
from ssiam import FrameView
from ssiam.geometry import rigid
from ssiam.trackers.confidence import AppearanceModel, RunningBaseline, box_feature


def drop_after(value, *, confident=False, first=1.0):
    """The drop of a value below a baseline of `first`, and of the same value once more."""
    baseline = RunningBaseline()
    assert baseline.update(first, confident) == 0
    return baseline.update(value, confident), baseline.update(value, confident)


def test_small_drops_are_ignored_and_large_ones_are_cut():
    assert drop_after(0.951)[0] == 0
    assert drop_after(0.93)[0] == pytest.approx(-0.02)
    assert drop_after(0.75)[0] == pytest.approx(-0.2)
    assert drop_after(0.74)[0] == -0.2


def test_the_mean_moves_by_a_share_of_the_difference():
    assert drop_after(0.91)[1] == pytest.approx(-0.09 * 0.95 + 0.05)
    assert drop_after(0.91, confident=True)[1] == pytest.approx(-0.09 * 0.8 + 0.05)
    assert drop_after(0.8)[1] == pytest.approx(-0.15)  # an outlier does not move it
    assert drop_after(0.8, confident=True)[1] == pytest.approx(-0.2 * 0.8 + 0.05)
    assert drop_after(-0.1, first=0.0)[1] == pytest.approx(-0.05)  # at the limit it does not


RAMP = np.stack([np.ones((9, 9)), *np.meshgrid(np.arange(9.0), np.arange(9.0))])


def averaged(*box):
    """Mean column and row of the cells in a box, of a map with 10 px between cells."""
    one, column, row = box_feature(RAMP[None].astype(np.float32), 10.0, np.array(box, float))
    return column / one, row / one


@pytest.mark.parametrize(
    ("box", "cells"),
    [
        ((0, 0, 10, 10), (4, 4)),
        ((10, -20, 10, 10), (5, 2)),
        ((4, 0, 10, 10), (4, 4)),
        ((6, 0, 10, 10), (5, 4)),
        ((5, 0, 25, 10), (4.5, 4)),  # .8 of the box's width: 20 px, of which half is 10
        ((0, 0, 24, 10), (4, 4)),
        ((5, 0, 38, 38), (4.5, 4)),
        ((40, 40, 30, 30), (7.5, 7.5)),
        ((-40, 0, 30, 10), (0.5, 4)),
        ((900, -900, 10, 10), (8, 0)),
        ((0, 0, 900, 900), (4, 4)),
    ],
)
def test_the_central_cells_of_a_box_are_averaged(box, cells):
    assert averaged(*box) == pytest.approx(cells)


def test_the_widest_cells_decide():
    """A range of cells: first and last are told by their mean and their number."""
    counts = np.ones((1, 2, 1, 9), np.float32)
    counts[0, 1, 0] = 2.0 ** np.arange(9)
    maps = np.repeat(counts, 9, axis=2)
    one, power = box_feature(maps, 10.0, np.array([0.0, 0.0, 60.0, 10.0]))
    assert power / one == pytest.approx(np.mean(2.0 ** np.arange(2, 7)))  # within 24 px
    assert np.hypot(one, power) == pytest.approx(1)


BOX = (300.0, 150.0, 40.0, 60.0)


def test_a_target_is_as_similar_as_can_be_to_itself():
    view = FrameView(world())
    model = AppearanceModel(view, BOX)
    assert model.similarity(view, BOX) == pytest.approx((1, 1), abs=1e-3)
    moved = FrameView(view.raw, rigid(30, -12, 0))
    assert model.similarity(moved, (330, 138, 40, 60)) == pytest.approx((1, 1), abs=1e-3)
    # One sample to the right and two down are within the two samples that are tried.
    columns, rows = model._grid_wh
    near = (300 + 40 / columns, 150 + 2 * 60 / rows, 40, 60)
    assert model.similarity(view, near) == pytest.approx((1, 1), abs=0.02)
    far = (300 + 4 * 40 / columns, 150, 40, 60)
    assert max(model.similarity(view, far)) < 0.9


@pytest.mark.parametrize(
    ("size", "grid"),
    [
        ((40, 40), (16, 16)),
        ((160, 160), (16, 16)),
        ((40, 90), (11, 24)),
        ((400, 4), (48, 6)),
        ((4, 400), (6, 48)),
    ],
)
def test_the_grid_has_sixteen_samples_along_the_targets_size(size, grid):
    assert AppearanceModel(FrameView(world()), (10.0, 10.0, *size))._grid_wh == grid


def test_the_recent_appearance_is_the_last_one():
    view = FrameView(world())
    model = AppearanceModel(view, BOX)
    other = (100.0, 80.0, 40.0, 60.0)
    model.update(view, other)
    first, recent = model.similarity(view, other)
    assert recent == pytest.approx(1, abs=1e-3)
    assert first < 0.7
    first, recent = model.similarity(view, BOX)
    assert first == pytest.approx(1, abs=1e-3)
    assert recent < 0.7


@pytest.mark.parametrize("offset", [(0, 0), (20, 0), (-20, 30), (30, -30)])
def test_a_displaced_target_is_found(offset):
    """Within the reach, to the size of a sample."""
    view = FrameView(world())
    model = AppearanceModel(view, BOX)
    x, y, w, h = BOX
    columns, rows = model._grid_wh
    dx, dy = offset
    start = (x + dx, y + dy, w, h)
    found = model.find(view, start, 0.75)
    assert found[0] == pytest.approx(x, abs=w / columns)
    assert found[1] == pytest.approx(y, abs=h / rows)
    assert found[2:] == (w, h)
    assert model.find(view, start, 0.0) == pytest.approx(start)


def test_the_search_also_knows_the_recent_appearance():
    view = FrameView(world())
    model = AppearanceModel(view, (100.0, 80.0, 40.0, 60.0))
    model.update(view, BOX)
    found = model.find(view, (310.0, 140.0, 40.0, 60.0), 0.75)
    assert found[:2] == pytest.approx(BOX[:2], abs=4)


def test_a_flat_target_is_similar_to_nothing():
    flat = FrameView(np.full((360, 640, 3), 90, np.uint8))
    model = AppearanceModel(flat, BOX)
    assert model.similarity(FrameView(world()), BOX) == (0, 0)
    assert model.similarity(flat, BOX) == (0, 0)
    textured = AppearanceModel(FrameView(world()), BOX)
    assert textured.similarity(flat, BOX) == (0, 0)


def test_features_are_averaged_in_double_precision():
    maps = np.random.default_rng(1).uniform(0, 1, (1, 4, 60, 60)).astype(np.float32)
    found = box_feature(maps, 1.0, np.array([0.0, 0.0, 100.0, 100.0]))
    mean = maps[0].astype(np.float64).mean(axis=(1, 2))
    np.testing.assert_allclose(found, mean / np.linalg.norm(mean), rtol=1e-12)
