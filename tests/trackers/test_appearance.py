"""The appearance model: similarity of a drawn target, and the search for it."""

import numpy as np
import pytest

from helpers.synthetic import camera_frame, world
from ssiam import FrameView
from ssiam.geometry import frame_center, map_box, rigid
from ssiam.trackers.confidence import AppearanceModel

SIZE = (640, 360)
BOXES = [
    pytest.param((300.0, 150.0, 48.0, 48.0), id="square"),
    pytest.param((280.0, 140.0, 90.0, 30.0), id="wide"),
    pytest.param((300.3, 130.7, 22.0, 70.0), id="high"),
    pytest.param((310.0, 160.0, 9.0, 7.0), id="small"),
]
BOX = (300.0, 150.0, 48.0, 48.0)
VIEW = rigid(25, -12, 0.15, frame_center(SIZE))
FLAT = np.full((360, 640, 3), 100, np.uint8)


def differences(box, other):
    return np.abs(np.subtract(box, other))


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("stab_from_raw", [np.eye(3), VIEW], ids=["raw", "stabilized"])
def test_similarity_is_1_on_the_target_and_low_elsewhere(box, stab_from_raw):
    appearance = AppearanceModel(FrameView(world()), box)
    view = FrameView(camera_frame(world(), np.linalg.inv(stab_from_raw)), stab_from_raw)
    similarity = appearance.similarity(view, box)
    assert min(similarity) > (0.999 if np.array_equal(stab_from_raw, np.eye(3)) else 0.8)
    elsewhere = [(80, 60), (500, 60), (80, 260), (500, 260)]
    others = [appearance.similarity(view, (x, y, *box[2:])) for x, y in elsewhere]
    assert np.max(others) < 0.8
    assert np.mean(others) < 0.6
    assert np.abs(others).max() <= 1


def test_a_box_two_samples_off_has_the_same_similarity():
    appearance = AppearanceModel(FrameView(world()), BOX)
    x, y, w, h = BOX
    step = w / 16  # a sample
    near = appearance.similarity(FrameView(world()), (x + 2 * step, y - step, w, h))
    far = appearance.similarity(FrameView(world()), (x + 8 * step, y - 6 * step, w, h))
    assert min(near) > 0.999
    assert max(far) < 0.8


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("reach", [0.5, 1.5])
@pytest.mark.parametrize(
    "direction", [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (0.6, -0.9), (-0.31, 0.77)]
)
def test_the_target_is_found_within_the_reach(box, reach, direction):
    appearance = AppearanceModel(FrameView(world()), box)
    columns, rows = appearance._grid_wh
    size = np.sqrt(box[2] * box[3])
    dx, dy = (0.95 * reach * size * d for d in direction)
    found = appearance.find(FrameView(camera_frame(world(), rigid(dx, dy, 0))), box, reach)
    error = differences(found, (box[0] + dx, box[1] + dy, *box[2:]))
    assert error[0] < box[2] / columns
    assert error[1] < box[3] / rows
    assert found[2:] == box[2:]


def test_boxes_are_in_the_views_pixels():
    appearance = AppearanceModel(FrameView(world()), BOX)
    raw = camera_frame(world(), rigid(30, 20, 0))
    view = FrameView(raw, rigid(-41, 14, 0.0))
    found = appearance.find(view, BOX, 1.5)
    assert differences(found, (289, 184, 48, 48)).max() < 3
    assert differences(map_box(view.raw_from_stab, found), (330, 170, 48, 48)).max() < 3


def test_an_update_replaces_the_recent_appearance_only():
    appearance = AppearanceModel(FrameView(world()), BOX)
    other = FrameView(world(seed=8))
    before = appearance.similarity(other, BOX)
    appearance.update(other, BOX)
    first, recent = appearance.similarity(other, BOX)
    assert first == before[0] < 0.5
    assert recent > 0.999
    first, recent = appearance.similarity(FrameView(world()), BOX)
    assert first > 0.999
    assert recent < 0.5


@pytest.mark.parametrize("light", [(0.5, 20), (0.7, 0), (0.8, 40)])
def test_similarity_does_not_depend_on_the_light(light):
    gain, bias = light
    appearance = AppearanceModel(FrameView(world()), BOX)
    changed = FrameView((world() * gain + bias).astype(np.uint8))
    assert min(appearance.similarity(changed, BOX)) > 0.99


@pytest.mark.parametrize("frame", [FLAT, np.zeros_like(FLAT), world()], ids=["flat", "0", "world"])
@pytest.mark.parametrize("target", [FLAT, world()], ids=["flat", "textured"])
@pytest.mark.parametrize("box", [BOX, (-300.0, -200.0, 48.0, 48.0), (620.0, 340.0, 90.0, 60.0)])
def test_flat_images_give_finite_results(target, frame, box):
    appearance = AppearanceModel(FrameView(target), BOX)
    assert np.isfinite(appearance.similarity(FrameView(frame), box)).all()
    assert np.isfinite(appearance.find(FrameView(frame), box, 1.5)).all()


def test_a_flat_patch_is_not_similar_to_a_textured_target():
    appearance = AppearanceModel(FrameView(world()), BOX)
    assert max(appearance.similarity(FrameView(FLAT), BOX)) < 0.1


def test_a_textured_patch_is_not_similar_to_a_flat_target():
    appearance = AppearanceModel(FrameView(FLAT), BOX)
    assert max(appearance.similarity(FrameView(world()), BOX)) < 0.9
