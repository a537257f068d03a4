"""Parts of the frame that show no scene: bars, a round image, moving borders."""

import csv
from functools import cache
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

import ssiam
from helpers.synthetic import generator, world
from ssiam.geometry import map_points, rigid
from ssiam.motion.content import ContentDetector
from ssiam.video import open_source

CLIP = Path(__file__).parents[2] / "examples" / "shaky-walker.mp4"
COUNT = 40
MORE = 0.1  # px of error more than on the cut video


@cache
def demo():
    """Frames of the demo clip, and clip_from_still of each."""
    frames = [f.image for f, _ in zip(open_source(str(CLIP)), range(COUNT), strict=False)]
    with CLIP.with_name("shaky-walker-motion.csv").open() as file:
        rows = [[float(row[key]) for key in ("dx", "dy", "angle")] for row in csv.DictReader(file)]
    return frames, [rigid(*row, (319.5, 179.5)) for row in rows[:COUNT]]


def framed(content, background):
    """`background` with the content (left, top, right, bottom) of the frame."""

    def form(_, frame):
        left, top, right, bottom = content
        out = np.empty_like(frame)
        out[...] = background(frame, content) if callable(background) else background
        out[top:bottom, left:right] = frame[top:bottom, left:right]
        return out

    return form, content


def blurred(frame, content):
    left, top, right, bottom = content
    large = cv2.resize(frame[top:bottom, left:right], (640, 640))[140:500]
    return cv2.GaussianBlur(large, (0, 0), 12)


def pattern(frame, _):
    blocks = generator(5).integers(0, 256, (36, 64, 3)).astype(np.uint8)
    return cv2.resize(blocks, frame.shape[1::-1], interpolation=cv2.INTER_NEAREST)


def disc(_, frame):
    shape = np.zeros(frame.shape[:2], np.uint8)
    cv2.circle(shape, (320, 180), 180, 255, -1)
    return cv2.bitwise_and(frame, frame, mask=shape)


def stabilized(t, frame):
    return cv2.warpAffine(frame, np.linalg.inv(demo()[1][t])[:2], (640, 360))


def through_jpeg(form):
    def coded(t, frame):
        data = cv2.imencode(".jpg", form(t, frame), [cv2.IMWRITE_JPEG_QUALITY, 70])[1]
        return cv2.imdecode(data, cv2.IMREAD_COLOR)

    return coded


PILLARS, WIDE = (80, 0, 560, 360), (0, 44, 640, 316)
FORMS = {
    "4:3 in 16:9": framed(PILLARS, 0),
    "2.35:1": framed(WIDE, 0),
    "2.35:1 in 4:3 in 16:9": framed((80, 44, 560, 316), 0),
    "9:16 in 16:9": framed((219, 0, 421, 360), 0),
    "narrow strip": framed((260, 0, 380, 360), 0),
    "white": framed(PILLARS, 255),
    "gray": framed(PILLARS, 128),
    "blurred background": framed(PILLARS, blurred),
    "blurred background, 9:16": framed((219, 0, 421, 360), blurred),
    "pattern": framed((100, 0, 540, 360), pattern),
    "lines of a capture card": framed((7, 3, 633, 357), 0),
    "round": (disc, (193, 53, 447, 307)),
    "stabilized": (stabilized, (60, 40, 580, 320)),
}


def motions(frames, keypoints):
    camera = ssiam.CameraMotion(keypoints)
    return [camera.update(frame) for frame in frames][1:]


def errors(found, truth, content, origin=(0, 0)):
    """Distance of the content's middle from where it should be; nan where not reliable."""
    left, top, right, bottom = content
    middle = np.array([((left + right) / 2, (top + bottom) / 2)])
    off = [
        map_points(m.cur_from_prev, middle - origin) + origin - map_points(t, middle)
        for m, t in zip(found, truth, strict=True)
    ]
    told = np.array([m.reliable for m in found])
    return np.where(told, np.linalg.norm(off, axis=2)[:, 0], np.nan)


@pytest.mark.parametrize("coded", [False, True])
@pytest.mark.parametrize("keypoints", ["direct", "orb", "gftt"])
@pytest.mark.parametrize("name", FORMS)
def test_what_shows_no_scene_has_no_vote(name, keypoints, coded):
    if coded and keypoints != "direct":
        pytest.skip("enough of it")
    form, content = FORMS[name]
    left, top, right, bottom = content
    frames, poses = demo()
    if coded:
        form = through_jpeg(form)
    shown = [form(t, frame) for t, frame in enumerate(frames)]
    if name == "stabilized":
        truth = [np.eye(3)] * (COUNT - 1)
    else:
        truth = [b @ np.linalg.inv(a) for a, b in pairwise(poses)]
    cut = [np.ascontiguousarray(frame[top:bottom, left:right]) for frame in shown]
    own = errors(motions(shown, keypoints), truth, content)
    least = errors(motions(cut, keypoints), truth, content, (left, top))
    both = ~np.isnan(own) & ~np.isnan(least)
    slack = 0.05 if coded or name in ("round", "stabilized") else 0.0  # not the cut's own pixels
    assert (own[both] <= least[both] + MORE + slack).all()
    assert np.nan_to_num(own).max() < 1.0
    if (right - left) * (bottom - top) >= 0.4 * 640 * 360 or name == "round":
        assert np.isnan(own).mean() <= 0.1
    else:
        assert np.isnan(own).sum() <= np.isnan(least).sum() + 1


def test_the_motion_of_a_barred_video_is_that_of_the_cut_one():
    form, (left, top, right, bottom) = FORMS["2.35:1 in 4:3 in 16:9"]
    shown = [form(t, frame) for t, frame in enumerate(demo()[0])]
    cut = [np.ascontiguousarray(frame[top:bottom, left:right]) for frame in shown]
    back, there = rigid(-left, -top, 0), rigid(left, top, 0)
    for whole, part in zip(motions(shown, "direct"), motions(cut, "direct"), strict=True):
        assert whole.size_wh == (640, 360)
        assert whole.reliable == part.reliable
        np.testing.assert_allclose(whole.cur_from_prev, there @ part.cur_from_prev @ back)


def test_the_excluded_box_is_left_out_of_a_barred_video_too():
    """A target of much of the content, that moves by itself."""
    patch = world(9)[:200, :230]
    camera = ssiam.CameraMotion()
    scene = world(3, (960, 540))
    for t in range(8):
        frame = scene[60 + 3 * t : 420 + 3 * t, 100 - 4 * t : 740 - 4 * t].copy()
        box = (170 + 10 * t, 60 + 6 * t, 230, 200)
        frame[box[1] : box[1] + 200, box[0] : box[0] + 230] = patch
        frame[:, :100] = frame[:, 540:] = 0
        before = (170 + 10 * max(t - 1, 0), 60 + 6 * max(t - 1, 0), 230, 200)
        motion = camera.update(frame, exclude=before)
        if t:
            assert motion.shift_angle[:2] == pytest.approx((4, -3), abs=0.3)


def test_bars_that_come_and_go_are_noticed():
    frames, poses = demo()
    form, _ = FORMS["9:16 in 16:9"]
    shown = [form(t, f) if 10 <= t < 25 else f for t, f in enumerate(frames)]
    truth = [b @ np.linalg.inv(a) for a, b in pairwise(poses)]
    own = errors(motions(shown, "direct"), truth, (219, 0, 421, 360))
    steady = [t for t in range(COUNT - 1) if t not in (9, 24)]  # steps into and out of the bars
    assert np.nan_to_num(own[steady]).max() < 0.5
    assert np.isnan(own[steady]).sum() <= 1


def test_a_scene_without_bars_is_not_cut():
    content = ContentDetector((640, 360))
    assert not any(content.update(frame) for frame in demo()[0])
    assert tuple(content.area) == (0, 0, 640, 360)


def test_a_flat_sky_gives_its_place_back_and_costs_few_changes():
    """A pan up and down over a skyline under a burnt-out sky."""
    scene = world(3, (960, 540))
    scene[:200] = 255
    content = ContentDetector((640, 360))
    changes = 0
    for t in range(120):
        y = 100 + round(60 * np.sin(t / 5))
        changes += content.update(scene[y : y + 360, 100:740])
    assert changes <= 16


def test_what_stands_still_beside_something_that_moves_is_a_scene():
    """A camera on a tripod: everything but one thing is without change."""
    scene, thing = world(3), world(8)[:180, :220]
    camera = ssiam.CameraMotion()
    for t in range(15):
        frame = scene.copy()
        frame[60 : 60 + 180, 40 + 9 * t : 260 + 9 * t] = thing
        motion = camera.update(frame)
        assert motion.shift_angle == pytest.approx((0, 0, 0), abs=0.05)


@pytest.mark.parametrize("keypoints", ["direct", "orb"])
@pytest.mark.parametrize("color", [0, 128, 255])
def test_the_motion_after_blank_frames_is_that_since_the_last_scene(keypoints, color):
    frames, poses = demo()
    camera = ssiam.CameraMotion(keypoints)
    camera.update(frames[0])
    camera.update(frames[1])
    blank = np.full_like(frames[0], color)
    assert not any(camera.update(blank).reliable for _ in range(5))
    motion = camera.update(frames[4])
    truth = poses[4] @ np.linalg.inv(poses[1])
    assert motion.reliable
    middle = [(320, 180)]
    off = map_points(motion.cur_from_prev, middle) - map_points(truth, middle)
    assert np.linalg.norm(off) < 1.0
