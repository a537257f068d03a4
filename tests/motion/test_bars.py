"""Bars beside the scene: where exactly they end, and when they are accepted."""

import numpy as np
import pytest

from helpers.synthetic import generator, world
from ssiam.motion.content import (
    _NO_BAR,
    Area,
    ContentDetector,
    _are_static,
    _Bar,
    _blurred_depth,
    _Depth,
    _flat_depth,
    _flat_edge,
    _from_side,
    _is_plain,
    _is_smooth,
    _outermost,
    _outline,
    _sharp_edge,
    _unchanged_depths,
)


def noise(height, width, low=60, high=256, seed=1):
    """Gray levels from `low` up to below `high`."""
    return generator(seed).integers(low, high, (height, width)).astype(np.uint8)


def in_color(gray):
    return np.repeat(gray[..., None], 3, axis=2)


def with_bars(frame, area, color=0):
    left, top, right, bottom = area
    out = np.full_like(frame, color)
    out[top:bottom, left:right] = frame[top:bottom, left:right]
    return out


def scene(size_wh):
    """A frame whose lines all differ clearly from a black bar."""
    return in_color(noise(size_wh[1], size_wh[0]))


AREAS = [
    pytest.param((640, 360), (80, 0, 560, 360), id="pillars"),
    pytest.param((640, 360), (0, 45, 640, 315), id="letterbox"),
    pytest.param((640, 360), (41, 22, 615, 350), id="four different bars"),
    pytest.param((640, 360), (7, 0, 640, 360), id="one side"),
    pytest.param((640, 360), (0, 0, 640, 353), id="bottom"),
    pytest.param((320, 240), (10, 20, 300, 230), id="as small as the small frame"),
    pytest.param((200, 160), (12, 5, 190, 150), id="smaller than the small frame"),
    pytest.param((1280, 720), (161, 90, 1117, 633), id="large"),
    pytest.param((361, 643), (31, 50, 333, 601), id="upright and odd"),
]


@pytest.mark.parametrize("color", [0, 255])
@pytest.mark.parametrize(("size", "area"), AREAS)
def test_bars_of_one_color_end_at_the_exact_line(size, area, color):
    frame = scene(size)
    if color:
        frame = 255 - frame  # far from white everywhere
    content = ContentDetector(size)
    assert content.area == Area(0, 0, *size)
    assert content.update(with_bars(frame, area, color)) == (area != (0, 0, *size))
    assert content.area == Area(*area)
    assert not content.update(with_bars(frame, area, color))
    assert not content.uncertain


@pytest.mark.parametrize("side", range(4))
@pytest.mark.parametrize(("share", "belongs"), [(0.4, False), (0.8, True)])
def test_a_line_that_blends_bar_and_content_belongs_to_the_bar(side, share, belongs):
    depth = 40
    gray = np.full((360, 640), 160, np.uint8) + noise(360, 640, 0, 40)
    lines = _from_side(gray, side)
    lines[:, :depth] = 0
    lines[:, depth] = lines[:, depth] * share
    content = ContentDetector((640, 360))
    content.update(in_color(gray))
    found = content.area
    depths = found.left, found.top, 640 - found.right, 360 - found.bottom
    expected = [0] * 4
    expected[side] = depth if belongs else depth + 1
    assert list(depths) == expected


def test_two_blended_lines_belong_to_the_bar_and_a_third_does_not():
    frame = in_color(np.full((8, 60), 200, np.uint8))
    frame[:, :20] = 0
    frame[:, 20], frame[:, 21] = 40, 90
    assert _flat_edge(frame, 20, 1.0) == 22
    frame[:, 20], frame[:, 21], frame[:, 22] = 20, 45, 90
    assert _flat_edge(frame, 20, 1.0) == 22


def test_the_edge_of_a_bar_in_the_last_columns():
    frame = in_color(np.full((8, 24), 200, np.uint8))
    frame[:, :23] = 0
    assert _flat_edge(frame, 23, 1.0) == 23
    frame[:, :1] = 0
    frame[:, 1:] = 200
    assert _flat_edge(frame, 1, 1.0) == 1


def test_stray_pixels_do_not_end_a_bar():
    """At most 2 % of a line may deviate by more than 8 gray levels from the outermost line."""
    frame = in_color(np.full((100, 60), 255, np.uint8))
    frame[:, :20] = 10
    frame[:, 18:20] = 18
    assert _flat_edge(frame, 20, 1.0) == 20
    frame[:2, 19] = 255
    assert _flat_edge(frame, 20, 1.0) == 20
    frame[:, 19] = 200
    assert _flat_edge(frame, 20, 1.0) == 19


def test_depth_of_one_color():
    lines = np.full((10, 30), 50, np.int16)
    assert _flat_depth(lines) == 30
    lines[3, 12] = 53
    lines[4, 14] = 54
    assert _flat_depth(lines) == 14
    lines[4, 9] = 46
    assert _flat_depth(lines) == 9
    lines[5, 0] = 54
    assert _flat_depth(lines) == 0


def test_plain_and_smooth_lines():
    assert _is_plain(np.array([10, 13, 7, 10], np.int16))
    assert not _is_plain(np.array([10, 14, 10, 10], np.int16))
    assert not _is_plain(np.array([10, 6, 10, 10], np.int16))
    assert _is_smooth(np.array([0, 50, 100, 150], np.int16))
    assert _is_smooth(np.array([0, 0, 12], np.int16))
    assert not _is_smooth(np.array([0, 0, 13], np.int16))
    assert not _is_smooth(np.array([0, 0, -13], np.int16))
    assert not _is_smooth(np.array([0, 0], np.int16))


def test_lines_are_counted_from_their_side():
    frame = np.arange(12).reshape(3, 4)
    expected = [frame, frame.T, frame[:, ::-1], frame.T[:, ::-1]]
    for side, lines in enumerate(expected):
        np.testing.assert_array_equal(_from_side(frame, side), lines)


def test_samples_are_on_the_outline():
    rows, columns = _outline((100, 60))
    assert rows.shape == columns.shape == (4, 16)
    assert set(columns[0]) == {0}
    assert set(rows[1]) == {0}
    assert set(columns[2]) == {99}
    assert set(rows[3]) == {59}
    for along, last in ((rows[0], 59), (columns[1], 99), (rows[2], 59), (columns[3], 99)):
        assert along.tolist() == [last * n // 15 for n in range(16)]


def test_the_outermost_line_is_averaged_over_8_pixels_of_green():
    frame = np.zeros((30, 50, 3), np.uint8)
    frame[0, :, 1] = np.arange(50)
    frame[0, :, 0] = frame[0, :, 2] = 200
    assert _outermost(frame, 1).tolist() == [3, 11, 19, 27, 35, 43]
    assert _outermost(frame[:, :24], 1).tolist() == [3, 11, 19]
    assert _outermost(frame[:, :23], 1).tolist() == list(range(23))
    frame[:, 49, 1] = 77
    assert _outermost(frame, 2).tolist() == [77] * 3


def blurred_lines(depth, height=60, width=100):
    """Columns of a gentle ramp, then noise that begins with a step."""
    lines = np.tile(np.arange(width) // 4, (height, 1)).astype(np.int16)
    lines[:, depth:] = noise(height, width - depth, 120)
    return lines


def test_depth_of_a_blurred_bar():
    for depth in (8, 12, 30, 42):
        found, straight = _blurred_depth(blurred_lines(depth))
        assert abs(found - depth) <= 4
        assert straight
    shifts = {_blurred_depth(blurred_lines(depth))[0] - depth for depth in (14, 20, 30, 40)}
    assert len(shifts) == 1


def test_no_blurred_bar():
    assert _blurred_depth(blurred_lines(3)) == (0, False), "too narrow"
    assert _blurred_depth(blurred_lines(60)) == (0, False), "more than half of the frame"
    assert _blurred_depth(noise(60, 100).astype(np.int16)) == (0, False)
    flat = np.zeros((60, 100), np.int16)
    assert _blurred_depth(flat) == (0, False)


def test_a_blurred_area_without_a_step_is_no_certain_bar():
    lines = blurred_lines(30)
    lines[:, 30:] = noise(60, 70, 0, 20)  # detail, at the level of the bar
    lines[:, :30] = 9
    depth, straight = _blurred_depth(lines)
    assert depth > 8
    assert not straight


def test_the_sharpest_step_is_the_edge():
    frame = in_color(np.tile(np.arange(100, dtype=np.uint8), (10, 1)))
    frame[:, 37:] += 60
    assert _sharp_edge(frame, 36, 1.0) == 37
    assert _sharp_edge(frame, 38, 1.0) == 37
    assert _sharp_edge(frame, 18, 2.0) == 37
    assert _sharp_edge(frame, 1, 1.0) <= 7
    frame[:, 1:] += 90
    assert _sharp_edge(frame, 1, 1.0) == 1


def changes(depths, shape=(60, 100)):
    changed = np.ones(shape, bool)
    for side, depth in enumerate(depths):
        _from_side(changed, side)[:, :depth] = False
    return changed


def test_areas_that_do_not_change():
    assert _unchanged_depths(changes([0, 0, 0, 0])) == [0, 0, 0, 0]
    assert _unchanged_depths(changes([20, 0, 20, 0])) == [20, 0, 20, 0]
    assert _unchanged_depths(changes([0, 10, 0, 12])) == [0, 10, 0, 12]
    assert _unchanged_depths(changes([20, 10, 18, 10])) == [20, 10, 18, 10]
    assert _unchanged_depths(changes([7, 0, 7, 0])) == [0, 0, 0, 0], "too narrow"
    assert _unchanged_depths(changes([8, 0, 8, 0])) == [8, 0, 8, 0]
    assert _unchanged_depths(changes([20, 0, 17, 0])) == [0, 0, 0, 0], "not even"
    assert _unchanged_depths(changes([20, 0, 0, 0])) == [0, 0, 0, 0], "one side"
    assert _unchanged_depths(np.zeros((60, 100), bool)) is None
    few = np.zeros((10, 10), bool)
    few[5, 5] = True
    assert _unchanged_depths(few) is None
    few[5, 4] = True
    assert _unchanged_depths(few) is not None


def test_content_whose_edge_hardly_changes_has_no_bars():
    changed = changes([20, 0, 20, 0])
    changed[:, 20:25] = False
    changed[:5, 20:25] = True  # 8 % of the first lines
    assert _unchanged_depths(changed) == [0, 0, 0, 0]
    changed[:7, 20:25] = True
    assert _unchanged_depths(changed) == [20, 0, 20, 0]


def test_bars_are_static_apart_from_their_inner_edge():
    depths = [20, 0, 20, 0]
    changed = changes(depths)
    assert _are_static(changed, depths)
    changed[:, 17:20] = True
    assert _are_static(changed, depths)
    changed[:, 16] = True
    assert not _are_static(changed, depths)
    changed[:, 16] = False
    changed[:20, 0] = True  # 20 of 17 * 60 pixels
    assert _are_static(changed, depths)
    changed[:21, 0] = True
    assert not _are_static(changed, depths)
    assert _are_static(np.ones((60, 100), bool), [3, 0, 2, 1]), "nothing but edges"


def test_a_bar_is_accepted_at_once_and_again_only_after_some_frames():
    bar, deep = _Bar(), _Depth(40, 20)
    assert (bar.depth, bar.small) == (0, 0)
    bar.update(deep)
    assert (bar.depth, bar.small) == (40, 20)
    bar.update(_NO_BAR)
    assert (bar.depth, bar.small) == (0, 0)
    needed = []
    for _ in range(8):
        count = 0
        while bar.depth == 0:
            bar.update(deep)
            count += 1
        needed.append(count)
        bar.update(_NO_BAR)
    assert needed == [2, 4, 8, 16, 32, 64, 64, 64]
    bar = _Bar()
    for each in (deep, _NO_BAR, deep, _NO_BAR):  # from now on it takes four frames
        bar.update(each)
    bar.update(deep)
    bar.update(_NO_BAR)
    assert bar.depth == 0


def test_a_deeper_bar_must_keep_its_depth():
    bar, deep, deeper = _Bar(), _Depth(40, 20), _Depth(60, 30)
    for each in (deep, _NO_BAR):
        bar.update(each)
    found = []
    for each in (deep, deeper, deep, deeper, deeper):
        bar.update(each)
        found.append(bar.depth)
    assert found == [0, 0, 0, 0, 60]
    bar.update(deeper)
    assert bar.depth == 60


def test_frames_without_content_do_not_change_the_area():
    content = ContentDetector((640, 360))
    frame = with_bars(scene((640, 360)), (80, 0, 560, 360))
    content.update(frame)
    assert not content.update(np.zeros_like(frame))
    narrow = with_bars(scene((640, 360)), (314, 0, 326, 360))  # 6 px of the small frame
    assert not content.update(narrow)
    assert content.area == Area(80, 0, 560, 360)
    assert ContentDetector((640, 360)).update(with_bars(frame, (300, 0, 340, 360)))


def test_without_bars_the_area_is_the_frame():
    content = ContentDetector((640, 360))
    for seed in range(30):
        assert not content.update(in_color(noise(360, 640, seed=seed)))
    assert content.area == Area(0, 0, 640, 360)
    assert not content.uncertain


def patterned(seed):
    """Changing content between bars of 80 px with a pattern that stays."""
    frame = in_color(noise(360, 640, 0, 100, seed=99))
    frame[:, 80:560] = in_color(noise(360, 480, 150, 256, seed=seed))
    return frame


def test_bars_with_a_pattern_are_accepted_after_three_changes():
    content = ContentDetector((640, 360))
    found = [(content.update(patterned(seed)), content.uncertain) for seed in range(6)]
    assert [changed for changed, _ in found] == [False, False, False, True, False, False]
    assert [uncertain for _, uncertain in found][:3] == [False, True, True]
    assert content.area == Area(80, 0, 560, 360)


def test_a_still_camera_has_no_bars():
    frame = world()
    content = ContentDetector((640, 360))
    assert not any(content.update(frame) for _ in range(8))
    assert not content.uncertain
