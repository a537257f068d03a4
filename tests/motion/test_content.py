"""Parts of the frame outside of the scene: bars, the outside of a disc, moving borders."""

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
MAX_EXTRA = 0.1  # px of error more than on the cropped video


@cache
def demo():
    """Frames of the demo clip, and clip_from_still of each."""
    frames = [f.image for f, _ in zip(open_source(str(CLIP)), range(COUNT), strict=False)]
    with CLIP.with_name("shaky-walker-motion.csv").open() as file:
        rows = [[float(row[key]) for key in ("dx", "dy", "angle")] for row in csv.DictReader(file)]
    return frames, [rigid(*row, (319.5, 179.5)) for row in rows[:COUNT]]


def framed(content, background):
    """A function that replaces all but the content (left, top, right, bottom) by `background`."""

    def transform(_, frame):
        left, top, right, bottom = content
        out = np.empty_like(frame)
        out[...] = background(frame, content) if callable(background) else background
        out[top:bottom, left:right] = frame[top:bottom, left:right]
        return out

    return transform, content


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


def through_jpeg(transform):
    def compressed(t, frame):
        data = cv2.imencode(".jpg", transform(t, frame), [cv2.IMWRITE_JPEG_QUALITY, 70])[1]
        return cv2.imdecode(data, cv2.IMREAD_COLOR)

    return compressed


PILLARS, WIDE = (80, 0, 560, 360), (0, 44, 640, 316)
LAYOUTS = {
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
    """Error of the mapped center of the content, pixels; nan where the motion is not reliable."""
    left, top, right, bottom = content
    center = np.array([((left + right) / 2, (top + bottom) / 2)])
    offsets = [
        map_points(m.cur_from_prev, center - origin) + origin - map_points(t, center)
        for m, t in zip(found, truth, strict=True)
    ]
    reliable = np.array([m.reliable for m in found])
    return np.where(reliable, np.linalg.norm(offsets, axis=2)[:, 0], np.nan)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("keypoints", ["direct", "orb", "gftt"])
@pytest.mark.parametrize("name", LAYOUTS)
def test_areas_outside_of_the_scene_are_not_used(name, keypoints, compressed):
    if compressed and keypoints != "direct":
        pytest.skip("compression is tested with direct only")
    transform, content = LAYOUTS[name]
    left, top, right, bottom = content
    frames, poses = demo()
    if compressed:
        transform = through_jpeg(transform)
    framed_frames = [transform(t, frame) for t, frame in enumerate(frames)]
    if name == "stabilized":
        truth = [np.eye(3)] * (COUNT - 1)
    else:
        truth = [b @ np.linalg.inv(a) for a, b in pairwise(poses)]
    cropped = [np.ascontiguousarray(frame[top:bottom, left:right]) for frame in framed_frames]
    found = errors(motions(framed_frames, keypoints), truth, content)
    expected = errors(motions(cropped, keypoints), truth, content, (left, top))
    both = ~np.isnan(found) & ~np.isnan(expected)
    slack = (
        0.05 if compressed or name in ("round", "stabilized") else 0.0
    )  # the pixels differ from the crop
    assert (found[both] <= expected[both] + MAX_EXTRA + slack).all()
    assert np.nan_to_num(found).max() < 1.0
    if (right - left) * (bottom - top) >= 0.4 * 640 * 360 or name == "round":
        assert np.isnan(found).mean() <= 0.1
    else:
        assert np.isnan(found).sum() <= np.isnan(expected).sum() + 1


def test_the_motion_with_bars_is_that_of_the_cropped_video():
    transform, (left, top, right, bottom) = LAYOUTS["2.35:1 in 4:3 in 16:9"]
    framed_frames = [transform(t, frame) for t, frame in enumerate(demo()[0])]
    cropped = [np.ascontiguousarray(frame[top:bottom, left:right]) for frame in framed_frames]
    crop_from_frame, frame_from_crop = rigid(-left, -top, 0), rigid(left, top, 0)
    for whole, part in zip(
        motions(framed_frames, "direct"), motions(cropped, "direct"), strict=True
    ):
        assert whole.size_wh == (640, 360)
        assert whole.reliable == part.reliable
        np.testing.assert_allclose(
            whole.cur_from_prev, frame_from_crop @ part.cur_from_prev @ crop_from_frame
        )


def test_boxes_are_excluded_from_a_video_with_bars():
    """An independently moving target that covers much of the content."""
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


def test_bars_that_appear_and_disappear_are_detected():
    frames, poses = demo()
    transform, _ = LAYOUTS["9:16 in 16:9"]
    framed_frames = [transform(t, f) if 10 <= t < 25 else f for t, f in enumerate(frames)]
    truth = [b @ np.linalg.inv(a) for a, b in pairwise(poses)]
    found = errors(motions(framed_frames, "direct"), truth, (219, 0, 421, 360))
    unchanged = [t for t in range(COUNT - 1) if t not in (9, 24)]  # steps into and out of the bars
    assert np.nan_to_num(found[unchanged]).max() < 0.5
    assert np.isnan(found[unchanged]).sum() <= 1


def test_a_scene_without_bars_is_not_cropped():
    content = ContentDetector((640, 360))
    assert not any(content.update(frame) for frame in demo()[0])
    assert tuple(content.area) == (0, 0, 640, 360)


def test_a_flat_sky_causes_few_changes_of_the_content():
    """A pan up and down over a skyline under an overexposed sky."""
    scene = world(3, (960, 540))
    scene[:200] = 255
    content = ContentDetector((640, 360))
    changes = 0
    for t in range(120):
        y = 100 + round(60 * np.sin(t / 5))
        changes += content.update(scene[y : y + 360, 100:740])
    assert changes <= 16


def test_a_static_scene_with_a_moving_object_is_content():
    """A camera on a tripod: everything but one object is unchanged."""
    scene, moving = world(3), world(8)[:180, :220]
    camera = ssiam.CameraMotion()
    for t in range(15):
        frame = scene.copy()
        frame[60 : 60 + 180, 40 + 9 * t : 260 + 9 * t] = moving
        motion = camera.update(frame)
        assert motion.shift_angle == pytest.approx((0, 0, 0), abs=0.05)


@pytest.mark.parametrize("keypoints", ["direct", "orb"])
@pytest.mark.parametrize("color", [0, 128, 255])
def test_the_motion_after_blank_frames_is_from_the_last_frame_before_them(keypoints, color):
    frames, poses = demo()
    camera = ssiam.CameraMotion(keypoints)
    camera.update(frames[0])
    camera.update(frames[1])
    blank = np.full_like(frames[0], color)
    assert not any(camera.update(blank).reliable for _ in range(5))
    motion = camera.update(frames[4])
    truth = poses[4] @ np.linalg.inv(poses[1])
    assert motion.reliable
    center = [(320, 180)]
    error = map_points(motion.cur_from_prev, center) - map_points(truth, center)
    assert np.linalg.norm(error) < 1.0
