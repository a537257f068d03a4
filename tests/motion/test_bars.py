"""Bars beside the scene: where exactly they end, and when they are accepted."""

import numpy as np
import pytest

from helpers.synthetic import generator, world
from ssiam.motion import content as content_module
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


def compared_and_searched(frames):
    """The frames whose outermost lines are compared, and those in which bars are searched."""
    detector, compared, searched = ContentDetector((640, 360)), [], []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            content_module, "_outermost", lambda *a: compared.append(number) or _outermost(*a)
        )
        find = detector._find_bars
        detector._find_bars = lambda *a: searched.append(number) or find(*a)
        for number, frame in enumerate(frames):  # noqa: B007
            detector.update(frame)
    return sorted(set(compared)), searched


def test_a_changing_scene_is_compared_in_two_of_seven_frames():
    frames = [in_color(noise(360, 640, seed=seed)) for seed in range(24)]
    compared, searched = compared_and_searched(frames)
    assert compared == [0, 1, 7, 8, 14, 15, 21, 22]
    assert searched == [0]


def test_a_still_scene_is_searched_at_growing_intervals():
    """After rests of 7, 15 and again 15 frames."""
    compared, searched = compared_and_searched([scene((640, 360))] * 62)
    assert compared == [0, 1, 8, 9, 10, 25, 26, 27, 42, 43, 44, 59, 60, 61]
    assert searched == [0, 1, 9, 10, 26, 27, 43, 44, 60, 61]


def test_bars_of_one_color_end_a_rest():
    frames = [in_color(noise(360, 640, seed=seed)) for seed in range(6)]
    content = ContentDetector((640, 360))
    for frame in frames[:4]:
        content.update(frame)
    assert content.update(with_bars(frames[4], (80, 0, 560, 360)))
    assert content.area == Area(80, 0, 560, 360)
    assert content.update(frames[5])
    assert content.area == Area(0, 0, 640, 360)


@pytest.mark.parametrize(("level", "compared"), [(24, True), (25, False)])
def test_a_side_of_about_one_color_is_looked_at(level, compared):
    """Its samples differ by up to 24 gray levels; the green channel counts."""
    frames = [in_color(noise(360, 640, seed=seed)) for seed in range(4)]
    frames[3][:, 0] = 100
    frames[3][::3, 0, 1] += np.uint8(level)
    found, _ = compared_and_searched(frames)
    assert (3 in found) is compared


def test_a_detector_at_first():
    content = ContentDetector((1280, 700))
    assert content._scale == 4
    assert content._small_wh == (320, 175)
    assert (content.area, content.uncertain) == (Area(0, 0, 1280, 700), False)
    small = ContentDetector((200, 100))
    assert (small._scale, small._small_wh) == (1, (200, 100))
    assert ContentDetector((3000, 2))._small_wh == (320, 1)
    assert ContentDetector((2, 3000))._small_wh == (1, 320)


def pattern_areas(count, seeds=None):
    content = ContentDetector((640, 360))
    found = []
    for seed in seeds or range(count):
        content.update(patterned(seed))
        found.append((tuple(content.area), content.uncertain))
    return content, found


def test_a_pattern_stays_while_it_does_not_change():
    content, found = pattern_areas(8)
    assert [area[0] for area, _ in found] == [0, 0, 0, 80, 80, 80, 80, 80]
    assert [uncertain for _, uncertain in found] == [False, True, True, True, *[False] * 4]
    # A still frame changes nothing.
    content.update(patterned(7))
    assert content.area == Area(80, 0, 560, 360)


def test_a_pattern_that_changes_is_content_at_once():
    content, _ = pattern_areas(6)
    assert content.update(scene((640, 360)))
    assert content.area == Area(0, 0, 640, 360)


def test_a_pattern_must_keep_its_depth():
    def frame(depth, seed):
        image = in_color(noise(360, 640, 0, 100, seed=99))
        width = 640 - 2 * depth
        image[:, depth : 640 - depth] = in_color(noise(360, width, 150, 256, seed=seed))
        return image

    content = ContentDetector((640, 360))
    for seed, depth in enumerate((80, 80, 100, 100, 100)):
        content.update(frame(depth, seed))
        assert content.area == Area(0, 0, 640, 360)
    content.update(frame(100, 5))
    assert content.area == Area(100, 0, 540, 360)


def blurred_frame(depth, seed):
    """Noise between two dark ramps from top to bottom."""
    frame = np.tile((np.arange(360) // 8).astype(np.uint8)[:, None], (1, 640))
    frame[:, depth : 640 - depth] = noise(360, 640 - 2 * depth, 150, 256, seed=seed)
    return in_color(frame)


def test_blurred_bars_are_found_in_the_first_frame():
    for depth in (60, 100, 180):
        content = ContentDetector((640, 360))
        assert content.update(blurred_frame(depth, 1))
        assert content.area == Area(depth, 0, 640 - depth, 360)
        assert not content.update(blurred_frame(depth, 2))


def test_blurred_bars_of_different_depths_are_none():
    frame = blurred_frame(100, 1)
    frame[:, 540:560] = in_color(noise(360, 20, 150, 256))
    content = ContentDetector((640, 360))
    assert not content.update(frame)


def test_blurred_bars_above_and_below():
    content = ContentDetector((360, 640))
    frame = np.ascontiguousarray(blurred_frame(100, 1).transpose(1, 0, 2))
    assert content.update(frame)
    assert content.area == Area(0, 100, 360, 540)


def found_patterns(*depths):
    """The depths that are returned if the unchanged areas have these depths, frame by frame."""
    content = ContentDetector((200, 160))
    gray = np.zeros((160, 200), np.int16)
    found = []
    with pytest.MonkeyPatch.context() as patch:
        for each in depths:
            patch.setattr(content_module, "_unchanged_depths", lambda changed, each=each: each)
            found.append(content._patterned(gray, gray))
    return content, found


NONE, BARS = [0] * 4, [20, 0, 20, 0]


def test_a_pattern_is_confirmed_by_three_frames_of_about_its_depth():
    """A pixel more or less is the same depth."""
    wider, wide = [21, 0, 19, 0], [22, 0, 20, 0]
    content, found = found_patterns(BARS, BARS, BARS)
    assert found == [NONE, NONE, BARS]
    assert content.uncertain
    assert found_patterns(BARS, wider, BARS)[1] == [NONE, NONE, BARS]
    assert found_patterns(BARS, wide, BARS, BARS, BARS)[1] == [NONE, NONE, NONE, NONE, BARS]
    assert found_patterns(BARS, BARS, None, BARS)[1] == [NONE, NONE, NONE, BARS]


def test_a_frame_without_a_pattern_starts_again():
    content, found = found_patterns(BARS, BARS, NONE, BARS, BARS)
    assert found == [NONE] * 5
    assert content.uncertain
    content, found = found_patterns(BARS, BARS, NONE)
    assert not content.uncertain
    assert found_patterns(BARS, BARS, NONE, BARS, BARS, BARS)[1][-1] == BARS


def test_without_a_previous_frame_nothing_is_compared():
    content = ContentDetector((200, 160))
    assert content._patterned(None, np.zeros((160, 200), np.int16)) == NONE
    assert not content.uncertain


def test_pixels_change_by_more_than_three_levels():
    content = ContentDetector((200, 160))
    seen = []
    gray = np.zeros((160, 200), np.int16)
    later = gray.copy()
    later[0, :4] = 3, -3, 4, -4
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            content_module, "_unchanged_depths", lambda changed: seen.append(changed) or NONE
        )
        content._patterned(gray, later)
    assert seen[0][0, :5].tolist() == [False, False, True, True, False]
    assert seen[0].sum() == 2


def test_known_bars_stay_while_they_are_static():
    content = ContentDetector((200, 160))
    for bar, depth in zip(content._bars, BARS, strict=True):
        bar.small = depth
    content.uncertain = True
    gray = np.zeros((160, 200), np.int16)
    later = gray.copy()
    later[:, 20:180] = 50
    assert content._patterned(gray, later) == BARS
    assert not content.uncertain
    later[:, 2:5] = 50
    assert content._patterned(gray, later) != BARS


def test_depths_near_those_of_known_bars_are_theirs():
    """Opposite bars are even within two pixels, and both end at a step or are known."""

    def blurred(*found, known=NONE):
        content = ContentDetector((200, 160))
        for bar, depth in zip(content._bars, known, strict=True):
            bar.small = depth
        with pytest.MonkeyPatch.context() as patch:
            depths = iter(found)
            patch.setattr(content_module, "_blurred_depth", lambda lines: next(depths))
            return content._blurred(np.zeros((160, 200), np.int16))

    sure, unsure, none = (20, True), (20, False), (0, False)
    assert blurred(sure, none, sure, none) == BARS
    assert blurred(sure, none, (22, True), none) == [20, 0, 22, 0]
    assert blurred(sure, none, (23, True), none) == NONE
    assert blurred(sure, none, unsure, none) == NONE
    assert blurred(none, sure, none, (18, True)) == [0, 20, 0, 18]
    assert blurred(unsure, none, unsure, none, known=BARS) == BARS
    assert blurred((19, False), none, (40, False), none, known=BARS) == BARS
    assert blurred((18, False), none, unsure, none, known=BARS) == NONE


@pytest.mark.parametrize(("levels", "content"), [(5, True), (4, False)])
def test_a_frame_that_deviates_by_less_than_two_and_a_half_levels_shows_nothing(levels, content):
    frame = np.full((240, 320, 3), 100, np.uint8)
    frame[:, ::2] += np.uint8(levels)  # a deviation of half of it
    found = ContentDetector((320, 240))._find_bars(frame, [False] * 4)
    assert (found is not None) is content


@pytest.mark.parametrize(("width", "content"), [(8, True), (7, False)])
def test_the_content_is_at_least_eight_pixels_wide_and_high(width, content):
    left = (320 - width) // 2
    gray = in_color(noise(240, 320))
    for frame, area in (
        (with_bars(gray, (left, 0, left + width, 240)), (320, 240)),
        (with_bars(gray.transpose(1, 0, 2).copy(), (0, left, 240, left + width)), (240, 320)),
    ):
        detector = ContentDetector(area)
        assert detector.update(np.ascontiguousarray(frame)) is content
