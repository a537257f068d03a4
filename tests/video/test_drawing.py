"""Drawing: which pixels change, and which must not."""

from __future__ import annotations

import numpy as np
import pytest

from ssiam.track import Track
from ssiam.video import draw_tracks, side_by_side

SIZES = [(320, 240), (1280, 720), (3840, 2160)]


def _gray(size_wh):
    return np.full((size_wh[1], size_wh[0], 3), 128, np.uint8)


def _changed(image, size_wh):
    return np.any(image != _gray(size_wh), axis=2)


def _box(size_wh):
    width, height = size_wh
    return (0.4 * width, 0.4 * height, 0.2 * width, 0.3 * height)


@pytest.mark.parametrize("size_wh", SIZES, ids=str)
def test_box_is_drawn_at_its_position_and_frame_not_modified(size_wh):
    width, height = size_wh
    frame = _gray(size_wh)
    changed = _changed(draw_tracks(frame, [Track(_box(size_wh))]), size_wh)
    assert not _changed(frame, size_wh).any()
    middle = changed[height // 2]
    edges = np.flatnonzero(middle)
    assert edges[0] == pytest.approx(0.4 * width, abs=0.01 * width)
    assert edges[-1] == pytest.approx(0.6 * width, abs=0.01 * width)
    # The inside of the box is not covered.
    assert not middle[round(0.42 * width) : round(0.58 * width)].any()
    # An edge with its rim is about 1 % of the height, in small frames up to 3 %.
    assert 0.004 < middle.sum() / 2 / height < 0.03


@pytest.mark.parametrize("size_wh", SIZES, ids=str)
def test_letters_scale_with_the_frame(size_wh):
    height = size_wh[1]
    drawn = draw_tracks(_gray(size_wh), [], fps=30.0)
    rows = np.flatnonzero(_changed(drawn, size_wh).any(axis=1))
    assert 0.02 < (rows[-1] - rows[0]) / height < 0.09
    assert rows[-1] < 0.1 * height
    columns = np.flatnonzero(_changed(drawn, size_wh).any(axis=0))
    assert columns[0] > 0.6 * size_wh[0]


def test_text_is_visible_on_white_and_black():
    for background in (0, 255):
        frame = np.full((240, 320, 3), background, np.uint8)
        drawn = draw_tracks(frame, [], fps=30.0).astype(int)
        assert abs(drawn - background).max() > 200


def test_lost_target_has_label_but_no_box():
    size_wh = (640, 480)
    changed = _changed(draw_tracks(_gray(size_wh), [Track(_box(size_wh), lost=True)]), size_wh)
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    assert rows[0] > 0.9 * 480
    assert columns[-1] < 0.2 * 640


def test_two_lost_targets_have_one_line_each():
    lost = Track((1, 1, 9, 9), lost=True)
    one, two = (
        _changed(draw_tracks(_gray((640, 480)), tracks), (640, 480)).any(axis=1).sum()
        for tracks in ([lost], [lost, lost])
    )
    assert two > 1.6 * one > 0


def test_targets_differ_in_color_and_number():
    boxes = [(100.0, 200.0, 80.0, 80.0), (400.0, 200.0, 80.0, 80.0)]
    drawn = draw_tracks(_gray((640, 480)), [Track(box) for box in boxes])
    edges = [drawn[240, round(x)] for x, _, _, _ in boxes]
    assert abs(edges[0].astype(int) - edges[1]).max() > 60
    alone = draw_tracks(_gray((640, 480)), [Track(boxes[0])])
    label = np.s_[150:197, 90:300]
    numbered_width, width = (
        np.flatnonzero(np.any(image[label] != 128, axis=(0, 2))).max() for image in (drawn, alone)
    )
    assert numbered_width > width


def test_mask_tints_only_its_pixels():
    mask = np.zeros((480, 640), bool)
    mask[200:260, 300:380] = True
    frame = _gray((640, 480))
    track = Track((300.0, 200.0, 80.0, 60.0), mask=mask)
    inner = np.s_[210:250, 310:370]
    drawn, plain = draw_tracks(frame, [track]), draw_tracks(frame, [Track(track.box)])
    assert np.all(np.any(drawn[inner] != 128, axis=2))
    assert np.array_equal(drawn[~mask], plain[~mask])
    # Translucent: a darker pixel stays darker.
    frame[230, 340] = 0
    assert draw_tracks(frame, [track])[230, 340].sum() < drawn[230, 340].sum()


@pytest.mark.parametrize("overlay", ["box", "trail"])
def test_of_these_overlays_a_target_has_one_box(overlay):
    corners = np.array([[320.0, 100.0], [420.0, 200.0], [320.0, 300.0], [220.0, 200.0]])
    track = Track((220.0, 100.0, 200.0, 200.0))
    frame = _gray((640, 480))
    drawn = draw_tracks(frame, [track.with_changes(corners=corners)], overlay=overlay)
    np.testing.assert_array_equal(drawn, draw_tracks(frame, [track], overlay=overlay))


def test_rotated_box_is_drawn_along_its_corners():
    corners = np.array([[320.0, 100.0], [420.0, 200.0], [320.0, 300.0], [220.0, 200.0]])
    frame = _gray((640, 480))
    drawn = draw_tracks(frame, [Track((220.0, 100.0, 200.0, 200.0), corners=corners)])
    for x, y in (corners + np.roll(corners, 1, axis=0)) / 2:
        assert np.any(drawn[round(y), round(x)] != 128)


ODD_BOXES = [
    ("left of the frame", (-500.0, 20.0, 100.0, 100.0)),
    ("over the top", (100.0, -30.0, 50.0, 60.0)),
    ("far outside", (1e9, -1e9, 1e8, 1e8)),
    ("larger than the frame", (-100.0, -100.0, 2000.0, 2000.0)),
    ("a point", (50.0, 50.0, 0.0, 0.0)),
]


@pytest.mark.parametrize("box", [b[1] for b in ODD_BOXES], ids=[b[0] for b in ODD_BOXES])
@pytest.mark.parametrize("size_wh", [(320, 240), (16, 12), (1, 1)], ids=str)
def test_unusual_boxes_and_tiny_frames(box, size_wh):
    drawn = draw_tracks(_gray(size_wh), [Track(box), Track(box, lost=True)], fps=12.3)
    assert drawn.shape == (size_wh[1], size_wh[0], 3)
    assert drawn.dtype == np.uint8


def test_label_stays_inside_the_frame():
    for box in ((0.0, 0.0, 30.0, 30.0), (290.0, 0.0, 40.0, 30.0), (-20.0, 150.0, 60.0, 89.0)):
        drawn = draw_tracks(_gray((320, 240)), [Track(box)])
        # Number of label pixels where nothing clips the label.
        free = draw_tracks(_gray((320, 240)), [Track((120.0, 100.0, 30.0, 30.0))])
        label = _changed(free, (320, 240))[75:97].sum()
        outside = np.ones((240, 320), bool)
        x, y, w, h = (round(value) for value in box)
        outside[max(0, y - 3) : y + h + 4, max(0, x - 3) : x + w + 4] = False
        assert (_changed(drawn, (320, 240)) & outside).sum() > 0.6 * label


SHAPES = [
    # name of the case, size of the stabilized image, part of the right panel that it fills
    ("same", (320, 240), (0, 240, 0, 320)),
    ("twice as large", (640, 480), (0, 240, 0, 320)),
    ("square", (240, 240), (0, 240, 40, 280)),
    ("wide", (320, 120), (60, 180, 0, 320)),
    ("smaller", (160, 120), (0, 240, 0, 320)),
]


@pytest.mark.parametrize(("size_wh", "part"), [s[1:] for s in SHAPES], ids=[s[0] for s in SHAPES])
def test_panels_are_equal_and_letterboxed(size_wh, part):
    raw, stabilized = _gray((320, 240)), np.full((size_wh[1], size_wh[0], 3), 200, np.uint8)
    both = side_by_side(raw, stabilized)
    assert both.shape == (240, 640, 3)
    top, bottom, left, right = part
    expected = np.zeros((240, 320), np.uint8)
    expected[top:bottom, left:right] = 200
    # Below the labels.
    assert np.array_equal(both[60:, 320:, 0], expected[60:])
    assert (both[60:, :320] == 128).all()
    assert not _changed(raw, (320, 240)).any()
    assert (stabilized == 200).all()


def test_panels_have_different_labels():
    both = side_by_side(_gray((320, 240)), _gray((320, 240)))
    labels = [_changed(both[:, x : x + 320], (320, 240)) for x in (0, 320)]
    widths = [np.flatnonzero(label.any(axis=0)).max() for label in labels]
    assert 0 < widths[0] < widths[1] < 160
