"""Blank frames: the box is held, and the target is tracked again afterwards."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

import ssiam
from helpers.synthetic import world
from ssiam.geometry import iou
from ssiam.trackers.blank_frames import (
    BlankFrameDetector,
    _is_covered,
    _is_flat,
    _repeated_rows,
)
from ssiam.video import open_source

CLIP = Path(__file__).parents[2] / "examples" / "shaky-walker.mp4"
BEFORE, AFTER = 20, 15  # frames before and after the gap


@cache
def demo():
    frames = [f.image for f, _ in zip(open_source(str(CLIP)), range(BEFORE + AFTER), strict=False)]
    return frames, np.loadtxt(CLIP.with_suffix(".txt"), delimiter=",")


def torn(frame, last_row=60):
    """A frame in which the decoder has lost all rows below `last_row` and repeats this row."""
    image = frame.copy()
    image[last_row:] = frame[last_row]
    return image


BLANK = {
    "black": np.zeros_like,
    "white": lambda frame: np.full_like(frame, 255),
    "gray": lambda frame: np.full_like(frame, 128),
    "noise": lambda frame: np.random.default_rng(1).normal(100, 2, frame.shape).astype(np.uint8),
    "torn": torn,
}


def spliced(kind, count):
    """The clip with `count` blank frames after frame BEFORE - 1, and the true boxes."""
    frames, truth = demo()
    gap = [BLANK[kind](frames[BEFORE - 1])] * count
    boxes = np.insert(truth[: len(frames)], [BEFORE] * count, truth[BEFORE - 1], axis=0)
    return [*frames[:BEFORE], *gap, *frames[BEFORE:]], boxes


def tracked(tracker, frames, box):
    tracker.init(frames[0], box)
    return [None, *(tracker.update(frame) for frame in frames[1:])]


def loaded(name, shared, **options):
    weights = shared("data/weights/" + name.replace("_", "")) if "nano" in name else None
    return ssiam.load_tracker(name, weights=weights, **options)


@pytest.mark.parametrize("count", [3, 10])
@pytest.mark.parametrize("kind", BLANK)
@pytest.mark.parametrize("name", ["lite", "nanotrack_v3", "kcf", "csrt"])
def test_the_box_is_held_and_the_target_is_found_again(name, kind, count, shared):
    if name in ("nanotrack_v3", "csrt") and (kind in ("gray", "noise") or count == 3):
        pytest.skip("covered by the other trackers")
    frames, truth = spliced(kind, count)
    tracks = tracked(loaded(name, shared), frames, truth[0])
    last_box = tracks[BEFORE - 1].box
    for track in tracks[BEFORE : BEFORE + count]:
        assert track.box == pytest.approx(last_box, abs=1.0)
        assert track.score == 0
    assert tracks[BEFORE + count - 1].lost
    for t in range(BEFORE + count, len(frames)):
        assert tracks[t].lost or iou(tracks[t].box, truth[t]) > 0.3
    if name in ("lite", "nanotrack_v3"):
        assert not tracks[-1].lost
        assert iou(tracks[-1].box, truth[-1]) > 0.5


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
@pytest.mark.parametrize("name", ["lite", "kcf"])
def test_blank_frames_do_not_change_the_trackers_state(name, stabilize, shared):
    config = ssiam.StabilizerConfig(stabilize)
    if name == "kcf":  # whose target is searched for after the gap, and then lost in another way
        config = config.with_options(find=False)
    frames, truth = spliced("black", 6)
    tracks = tracked(loaded(name, shared, stabilize=config), frames, truth[0])
    for track in tracks[BEFORE : BEFORE + 6]:
        assert track.box == pytest.approx(tracks[BEFORE - 1].box, abs=1e-6)
    plain = tracked(loaded(name, shared, stabilize=config), demo()[0], truth[0])
    for after, same in zip(tracks[BEFORE + 6 :], plain[BEFORE:], strict=True):
        if stabilize == "predict":  # a new view is chosen, so the crops differ
            assert iou(after.box, same.box) > 0.8
            assert after.score == pytest.approx(same.score, abs=0.2)
        else:
            assert after.score == pytest.approx(same.score, abs=1e-6)
            assert after.box == pytest.approx(same.box, abs=1e-6)


def test_following_frames_do_not_change_results(shared):
    frames, truth = spliced("black", 4)
    alone, ahead = loaded("kcf", shared), loaded("kcf", shared)
    expected = tracked(alone, frames, truth[0])
    ahead.init(frames[0], truth[0])
    for t in range(1, len(frames)):
        following = frames[t + 1] if t + 1 < len(frames) else None
        assert ahead.update(frames[t], following=following).box == expected[t].box


def test_a_lost_box_does_not_leave_the_frame(shared):
    """The camera pans away from the target."""
    scene = world(3, (3000, 360))
    tracker = loaded("kcf", shared)
    tracker.init(scene[:, :640], (500, 150, 60, 60))
    for t in range(1, 90):
        left = 25 * t
        track = tracker.update(np.ascontiguousarray(scene[:, left : left + 640]))
        if track.lost:
            x, y, w, h = track.box
            assert -w <= x <= 640
            assert -h <= y <= 360
    assert track.lost


BOX = (300.0, 150.0, 40.0, 50.0)


@pytest.mark.parametrize("kind", BLANK)
def test_blank_frames_are_detected(kind):
    frame = world()
    detector = BlankFrameDetector(frame)
    assert not detector.is_blank(frame, BOX, lost=False)
    assert detector.is_blank(BLANK[kind](frame), BOX, lost=False)
    assert not detector.is_blank(frame, BOX, lost=True)


def test_a_frame_torn_below_the_target_is_not_blank():
    frame = world()
    detector = BlankFrameDetector(frame)
    assert not detector.is_blank(torn(frame, 220), BOX, lost=False)


def test_repeated_rows_of_the_first_frame_are_part_of_the_scene():
    frame = world()
    frame[:140] = 255
    detector = BlankFrameDetector(frame)
    for _ in range(3):
        assert not detector.is_blank(frame, BOX, lost=False)


def test_a_lost_target_in_a_flat_area_is_searched_in_the_whole_frame():
    frame = world()
    frame[:300, :400] = 200
    detector = BlankFrameDetector(frame)
    assert detector.is_blank(frame, (100, 100, 40, 50), lost=False)
    assert not detector.is_blank(frame, (100, 100, 40, 50), lost=True)


def test_torn_rows_that_stay_are_accepted_as_part_of_the_scene():
    frame = world()
    detector = BlankFrameDetector(frame)
    blank = [detector.is_blank(torn(frame, 130), (300, 120, 40, 60), lost=True) for _ in range(40)]
    assert all(blank[:20])
    assert not blank[-1]


def _noise(frame, random):
    return random.integers(0, 255, frame.shape, dtype=np.uint8)


def _clouds(frame, random):
    small = random.integers(0, 255, (24, 40, 3), dtype=np.uint8)
    return cv2.resize(small, frame.shape[1::-1], interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize("unrelated", [_noise, _clouds])
@pytest.mark.parametrize("stabilize", ["paper", "predict"])
def test_the_box_is_held_in_frames_of_another_scene(unrelated, stabilize):
    """Such frames have texture, but show neither the scene nor the target."""
    frames, truth = demo()
    random = np.random.default_rng(0)
    between = [unrelated(frames[BEFORE], random) for _ in range(3)]
    tracker = ssiam.load_tracker("lite", stabilize=stabilize)
    tracks = tracked(tracker, [*frames[:BEFORE], *between, *frames[BEFORE:]], truth[0])
    for track in tracks[BEFORE : BEFORE + 3]:
        assert track.score == 0
        assert track.box == pytest.approx(tracks[BEFORE - 1].box, abs=1e-6)
    plain = tracked(ssiam.load_tracker("lite", stabilize=stabilize), frames, truth[0])
    for track, expected in zip(tracks[BEFORE + 3 :], plain[BEFORE:], strict=True):
        assert iou(track.box, expected.box) > 0.5


def gradient(levels, size=(200, 100)):
    """A gray image whose rows rise by this many levels in total."""
    rows = np.linspace(100, 100 + levels, size[1]).round().astype(np.uint8)
    return np.tile(rows[:, None, None], (1, size[0], 3))


@pytest.mark.parametrize(("levels", "flat"), [(0, True), (6, True), (9, False)])
def test_a_flat_area_has_a_range_of_at_most_six_levels(levels, flat):
    """A sample is the mean of six rows."""
    assert _is_flat(gradient(levels), None) is flat


def test_columns_that_repeat_a_row_are_flat():
    frame = np.tile(np.arange(200, dtype=np.uint8)[None, :, None], (100, 1, 3))
    assert _is_flat(frame, None)
    assert not _is_flat(np.ascontiguousarray(frame.transpose(1, 0, 2)), None)


def textured_except(area, size=(320, 240)):
    frame = np.random.default_rng(2).integers(0, 256, (size[1], size[0], 3)).astype(np.uint8)
    frame = cv2.resize(frame[::16, ::16], size, interpolation=cv2.INTER_NEAREST)
    left, top, right, bottom = area
    frame[top:bottom, left:right] = 90
    return frame


@pytest.mark.parametrize(
    ("box", "flat"),
    [
        ((150, 110, 20, 10), True),  # 30 px more on each side: 120..200 and 80..150
        ((145, 110, 20, 10), False),
        ((155, 110, 20, 10), False),
        ((150, 105, 20, 10), False),
        ((150, 115, 20, 10), False),
        ((155, 105, 10, 16), True),
        ((150, 110, 26, 10), False),
    ],
)
def test_the_area_around_the_box_is_one_and_a_half_times_its_longer_side_larger(box, flat):
    assert _is_flat(textured_except((120, 80, 200, 150)), box) is flat


@pytest.mark.parametrize(
    ("box", "flat"),
    [
        ((-25, 100, 10, 10), False),  # none of the area is in the frame
        ((-14, 100, 10, 10), False),  # 11 px of it are
        ((-8, 100, 10, 10), True),
        ((100, 238, 10, 10), True),
        ((100, 245, 10, 10), False),
    ],
)
def test_an_area_of_which_too_little_is_in_the_frame_is_not_flat(box, flat):
    assert _is_flat(np.full((240, 320, 3), 90, np.uint8), box) is flat


def test_repeated_rows():
    """Rows are compared with that four rows below, at 48 heights."""
    frame = np.random.default_rng(2).integers(0, 256, (96, 200, 3)).astype(np.uint8)
    assert not _repeated_rows(frame).any()
    assert len(_repeated_rows(frame)) == 46
    frame[40:60] = frame[40]
    np.testing.assert_array_equal(np.flatnonzero(_repeated_rows(frame)), np.arange(20, 28))
    for difference, count in ((4, 8), (5, 6)):
        frame[40:60] = 100
        frame[44, ::2] = frame[48, ::2] = 100 + difference
        assert _repeated_rows(frame)[20:28].sum() == count


@pytest.mark.parametrize(("height", "count"), [(1, 1), (4, 1), (5, 1), (6, 2), (48, 44)])
def test_low_frames(height, count):
    assert len(_repeated_rows(np.zeros((height, 50, 3), np.uint8))) == count
    if height <= 4:
        assert not _repeated_rows(np.zeros((height, 50, 3), np.uint8)).any()


def torn_from(first, count=50):
    rows = np.zeros(count, bool)
    rows[first:] = True
    return rows


@pytest.mark.parametrize(
    ("first", "covered"), [(30, True), (26, True), (36, True), (37, False), (50, False)]
)
def test_a_target_is_covered_from_two_fifths_on(first, covered):
    """The box is at rows 30 to 40 of 50; a row is 10 px."""
    assert _is_covered(torn_from(first), 500, (0, 301, 10, 98)) is covered


def test_a_box_between_two_rows_takes_the_nearest():
    assert _is_covered(torn_from(30), 500, (0, 306, 10, 3))
    assert not _is_covered(torn_from(31), 500, (0, 306, 10, 3))
    assert _is_covered(torn_from(49), 500, (0, 700, 10, 3))
    assert not _is_covered(~torn_from(1), 500, (0, 16, 10, 3))


def test_blank_frames_are_counted_until_one_is_not():
    frame = world()
    detector = BlankFrameDetector(frame)
    for _ in range(30):
        assert detector.is_blank(np.zeros_like(frame), BOX, lost=False)
    assert not detector.is_blank(torn(frame, 130), (300, 120, 40, 60), lost=False)
    assert not detector.is_blank(frame, BOX, lost=False)
    blank = [detector.is_blank(torn(frame, 130), (300, 120, 40, 60), lost=True) for _ in range(27)]
    assert blank == [True] * 25 + [False] * 2


@pytest.mark.parametrize(
    "arranged",
    [lambda f: f[..., ::-1], lambda f: f[:, ::-1], lambda f: f[::2, 3:-5], np.asfortranarray],
    ids=["RGB", "mirrored", "part", "by column"],
)
@pytest.mark.parametrize("kind", ["torn", "gray", "noise"])
def test_frames_may_be_views_of_others(kind, arranged):
    frame = arranged(BLANK[kind](demo()[0][BEFORE]))
    contiguous = np.ascontiguousarray(frame)
    np.testing.assert_array_equal(_repeated_rows(frame), _repeated_rows(contiguous))
    for box in (None, (40.0, 60.0, 50.0, 40.0)):
        assert _is_flat(frame, box) == _is_flat(contiguous, box)


@pytest.mark.parametrize("kind", ["torn", "noise"])
def test_a_prepared_frame_gives_the_same_answers(kind, monkeypatch):
    frames = [*demo()[0][:3], BLANK[kind](demo()[0][3]), *demo()[0][4:7]]
    plain, prepared = BlankFrameDetector(frames[0]), BlankFrameDetector(frames[0])
    for frame in frames[1:]:
        box = (50.0, 110.0, 30.0, 60.0)
        expected = plain.is_blank(frame, box, lost=False)
        prepared.prepare(frames[0])  # of another frame, which has no effect
        assert prepared.is_blank(frame, box, lost=False) == expected
    assert (prepared._repeated_rows == plain._repeated_rows).all()
    prepared.prepare(frames[1])
    monkeypatch.setattr("ssiam.trackers.blank_frames._repeated_rows", None)
    assert not prepared.is_blank(frames[1], box, lost=False)
