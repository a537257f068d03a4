"""Overlays, scene cuts, outliers and textured targets do not change the estimated motion."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import generator, poses, world
from ssiam import CameraMotion
from ssiam.geometry import map_points, rigid
from ssiam.motion.fit import fit_motion
from ssiam.motion.keypoints import _spread

SIZE = (640, 360)
SCENE = world(3, (960, 540))
MIDDLE_FROM_SCENE = rigid(-160, -90, 0)
CORNERS = np.array([[0, 0], [640, 0], [640, 360], [0, 360]])


def view(frame_from_middle, scene=SCENE):
    """A frame of a camera that looks at the middle of a larger scene."""
    return cv2.warpAffine(scene, (frame_from_middle @ MIDDLE_FROM_SCENE)[:2], SIZE)


def corner_error(found, truth):
    """Mean distance of the frame's corners under two transforms, pixels."""
    return np.hypot(*(map_points(found, CORNERS) - map_points(truth, CORNERS)).T).mean()


def with_panels(frame):
    """A frame with four opaque panels of a display, 32 % of its area."""
    covered, panels = frame.copy(), world(9, SIZE)
    for x, y in ((60, 40), (350, 40), (60, 190), (350, 190)):
        covered[y : y + 130, x : x + 140] = panels[y : y + 130, x : x + 140]
    return covered


def test_a_detected_overlay_is_not_used_in_slow_motion():
    """The panels are detected in a fast pan; in a slow pan, no motion fits them almost as well."""
    fast, slow = 12.0 * np.arange(6), 60 + 1.5 * np.arange(1, 9)
    path = [rigid(dx, 0, 0) for dx in (*fast, *slow)]
    camera = CameraMotion()
    found = [camera.update(with_panels(view(pose))).cur_from_prev for pose in path]
    errors = [
        corner_error(found[t], path[t] @ np.linalg.inv(path[t - 1]))
        for t in range(len(fast), len(path))
    ]
    assert max(errors) < 0.25


SMOOTH = cv2.resize(world(5, (240, 240)), (720, 720), interpolation=cv2.INTER_CUBIC)
SIDE = 300  # px, of the frames


@pytest.mark.parametrize("keypoints", ["direct", "gftt"])
@pytest.mark.parametrize(
    ("share", "reliable"),
    [pytest.param(0.19, True, id="27 %"), pytest.param(0.23, False, id="33 %")],
)
def test_a_jump_beyond_30_percent_of_the_longer_side_is_unreliable(keypoints, share, reliable):
    """Both jumps can be estimated; the longer one is a cut."""
    shift = round(share * SIDE)
    camera = CameraMotion(keypoints)
    for start in (150, 150 - shift):
        motion = camera.update(SMOOTH[start : start + SIDE, start : start + SIDE].copy())
    assert motion.reliable == reliable
    expected = (shift, shift) if reliable else (0, 0)
    assert motion.shift_angle[:2] == pytest.approx(expected, abs=0.5)


def test_the_robust_fit_finds_the_largest_group_away_from_the_mean():
    """With three motions, the least-squares fit is close to the middle one."""
    r = generator(1)
    prev_xy = r.uniform((0, 0), (640, 360), (150, 2))
    truth = rigid(12, -5, 0.02, (320, 180))
    cur_xy = map_points(truth, prev_xy) + r.normal(0, 0.2, (150, 2))
    cur_xy[60:105] += (60.0, 0.0)
    cur_xy[105:] += (120.0, 0.0)
    found, inliers = fit_motion(prev_xy, cur_xy, "robust", tolerance=1.5)
    assert corner_error(found, truth) < 0.3
    assert inliers == pytest.approx(60 / 150, abs=0.02)


def test_the_strongest_keypoint_of_each_cell_is_used():
    """Cells are 40 x 30 pixels; keypoints are sorted, strongest first."""
    points = np.array([[5, 5], [39, 29], [41, 5], [6, 6], [639, 359]], np.float32)
    spread = _spread(points, SIZE)
    assert sorted(map(tuple, spread.tolist())) == [(5, 5), (41, 5), (639, 359)]


@pytest.mark.parametrize("keypoints", ["orb", "gftt"])
def test_a_small_textured_target_has_no_effect_without_its_box(keypoints):
    """It covers 5 % of the frame and has most of the keypoints."""
    pale = (SCENE // 3 + 90).astype(np.uint8)
    target = np.clip((world(9)[:90, :120].astype(int) - 120) * 2 + 120, 0, 255).astype(np.uint8)
    path = poses(generator(4).normal(0, (4, 4, 0.005), (8, 3)), SIZE)
    camera = CameraMotion(keypoints)
    for t, pose in enumerate(path):
        frame = view(pose, pale)
        frame[60 + 5 * t : 150 + 5 * t, 100 + 9 * t : 220 + 9 * t] = target
        found = camera.update(frame).cur_from_prev
        truth = pose @ np.linalg.inv(path[t - 1]) if t else np.eye(3)
        assert corner_error(found, truth) < 0.5


PEDESTRIANS = [(60, 120, 90, 200), (260, 100, 90, 220), (450, 130, 80, 180)]


@pytest.mark.parametrize(
    ("dx", "dy", "angle"),
    [(-40, -61, 0.122), (60, -79, 0.085), (62, 79, -0.124), (-73, -52, 0.128)],
)
def test_strong_shake_with_excluded_boxes(dx, dy, angle):
    """The first coarse estimate, of the settings for frames with boxes, does not converge."""
    shaken = rigid(dx, dy, angle, (320, 180))
    camera = CameraMotion()
    camera.update(view(np.eye(3)))
    motion = camera.update(view(shaken), exclude=PEDESTRIANS)
    assert motion.reliable
    assert corner_error(motion.cur_from_prev, shaken) < 0.5


def test_an_excluded_box_that_fills_the_frame_decides_nothing():
    """The background is noise: its motion is unknown, and that of the box is not the camera's."""
    box = 30, 20, 580, 320
    noise = generator(4)
    camera = CameraMotion()
    for dx in (0, 25):
        frame = noise.integers(0, 256, (360, 640, 3), np.uint8)
        frame[20:340, 30:610] = view(rigid(dx, 0, 0))[20:340, 30:610]
        motion = camera.update(frame, exclude=box)
    assert not motion.reliable
