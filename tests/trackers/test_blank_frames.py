"""Blank frames: the box is held, and the target is tracked again afterwards."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

import ssiam
from helpers.synthetic import world
from ssiam.geometry import iou
from ssiam.trackers.blank_frames import BlankFrameDetector
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
    frames, truth = spliced("black", 6)
    tracks = tracked(loaded(name, shared, stabilize=stabilize), frames, truth[0])
    for track in tracks[BEFORE : BEFORE + 6]:
        assert track.box == pytest.approx(tracks[BEFORE - 1].box, abs=1e-6)
    plain = tracked(loaded(name, shared, stabilize=stabilize), demo()[0], truth[0])
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
