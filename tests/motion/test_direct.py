"""Direct alignment: recovered motions, and robustness."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.synthetic import generator, poses, world
from ssiam import CameraMotion
from ssiam.geometry import frame_center, map_points, rigid

SIZE = (640, 360)
SCENE = world(3, (960, 540))
CORNERS = np.array([[0, 0], [640, 0], [640, 360], [0, 360]])

MOTIONS = {  # up to 5 % of the width, and 3 degrees
    "dx": st.floats(-32, 32),
    "dy": st.floats(-32, 32),
    "angle": st.floats(-np.deg2rad(3), np.deg2rad(3)),
}


def view(frame_from_center, scene=SCENE, size_wh=SIZE):
    """The frame of a camera before a scene that is larger than the frame."""
    (height, width), (frame_w, frame_h) = scene.shape[:2], size_wh
    center_from_scene = rigid((frame_w - width) / 2, (frame_h - height) / 2, 0)
    return cv2.warpAffine(scene, (frame_from_center @ center_from_scene)[:2], size_wh)


def between(prev, cur, **options):
    camera = CameraMotion(**options)
    camera.update(prev)
    return camera.update(cur)


def corner_error(found, truth):
    return np.hypot(*(map_points(found, CORNERS) - map_points(truth, CORNERS)).T).mean()


@settings(max_examples=40, deadline=None)
@given(**MOTIONS, model=st.sampled_from(["rigid", "similarity"]))
def test_rigid_motions_are_recovered(dx, dy, angle, model):
    truth = rigid(dx, dy, angle, frame_center(SIZE))
    motion = between(view(np.eye(3)), view(truth), model=model)
    found_dx, found_dy, found_angle = motion.shift_angle
    assert motion.reliable
    assert np.hypot(found_dx - dx, found_dy - dy) < 0.1
    assert abs(np.rad2deg(found_angle - angle)) < 0.02


@settings(max_examples=20, deadline=None)
@given(**MOTIONS)
def test_the_reversed_pair_gives_the_inverse(dx, dy, angle):
    prev, cur = view(np.eye(3)), view(rigid(dx, dy, angle, frame_center(SIZE)))
    forward, backward = between(prev, cur), between(cur, prev)
    assert corner_error(backward.cur_from_prev @ forward.cur_from_prev, np.eye(3)) < 0.2


@settings(max_examples=20, deadline=None)
@given(**MOTIONS, scale=st.sampled_from([0.5, 0.75, 1.5, 2.0]))
def test_scaling_the_frames_scales_the_motion(dx, dy, angle, scale):
    frames = view(np.eye(3)), view(rigid(dx, dy, angle, frame_center(SIZE)))
    unscaled = between(*frames).shift_angle
    scaled = between(
        *(
            cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            for frame in frames
        )
    ).shift_angle
    assert scaled[:2] == pytest.approx(np.multiply(unscaled[:2], scale), abs=0.15 * max(scale, 1))
    assert scaled[2] == pytest.approx(unscaled[2], abs=5e-4)


@pytest.mark.parametrize("size_wh", [(1280, 720), (480, 854), (320, 240), (200, 150)])
def test_frames_of_any_size_and_shape(size_wh):
    scene = world(4, tuple(int(1.5 * side) for side in size_wh))
    truth = rigid(0.04 * size_wh[0], -0.03 * size_wh[1], 0.02, frame_center(size_wh))
    motion = between(view(np.eye(3), scene, size_wh), view(truth, scene, size_wh))
    assert motion.shift_angle == pytest.approx(
        (0.04 * size_wh[0], -0.03 * size_wh[1], 0.02), abs=2e-4 * max(size_wh)
    )


def test_a_jump_of_a_sixth_of_the_width_is_recovered():
    truth = rigid(105, -40, 0.05, frame_center(SIZE))
    motion = between(view(np.eye(3)), view(truth))
    assert motion.reliable
    assert corner_error(motion.cur_from_prev, truth) < 0.3


CHANGES = {
    "similarity": np.array([[1.02, -0.01, 4], [0.01, 1.02, -6], [0, 0, 1]]),
    "affine": np.array([[1.02, 0.02, 4.0], [-0.01, 0.98, -6.0], [0, 0, 1]]),
    "homography": np.array([[1.0, 0.01, 4.0], [-0.01, 0.99, -6.0], [4e-5, -3e-5, 1]]),
}


@pytest.mark.parametrize("model", CHANGES)
def test_each_model_recovers_more_than_the_smaller_one(model):
    smaller = {"similarity": "rigid", "affine": "similarity", "homography": "affine"}[model]
    prev, truth = view(np.eye(3)), CHANGES[model]
    center_from_scene = rigid(-160, -90, 0)
    cur = cv2.warpPerspective(SCENE, truth @ center_from_scene, SIZE)
    assert corner_error(between(prev, cur, model=model).cur_from_prev, truth) < 0.15
    assert corner_error(between(prev, cur, model=smaller).cur_from_prev, truth) > 0.5


def shaken(count, shift, seed=3):
    """Poses of a camera with white shake, and the true cur_from_prev of each."""
    steps = generator(seed).normal(0, (shift, shift, 0.01), (count, 3))
    path = poses(steps, SIZE)
    pairs = zip(path[1:], path[:-1], strict=True)
    return path, [np.eye(3)] + [cur @ np.linalg.inv(prev) for cur, prev in pairs]


def paste(frame, patch, x, y):
    pasted = frame.copy()
    pasted[y : y + patch.shape[0], x : x + patch.shape[1]] = patch
    return pasted


def test_a_target_of_a_quarter_of_the_frame_has_no_effect_without_a_box():
    target = world(seed=9)[:180, :320]
    target = np.clip((target.astype(int) - 120) * 2 + 120, 0, 255).astype(np.uint8)
    pale = (SCENE // 2 + 60).astype(np.uint8)
    path, truths = shaken(12, shift=8.0)
    camera = CameraMotion()
    for t, (pose, truth) in enumerate(zip(path, truths, strict=True)):
        frame = paste(view(pose, pale), target, 40 + 9 * t, 30 + 8 * t)
        assert corner_error(camera.update(frame).cur_from_prev, truth) < 1.0


def test_a_target_of_most_of_the_frame_has_no_effect_with_its_box():
    target = world(seed=9)[:280, :460]  # 56 %
    path, truths = shaken(6, shift=3.0)
    boxes = [(40 + 12 * t, 30 + 6 * t, 460, 280) for t in range(6)]
    camera, without_box = CameraMotion(), CameraMotion()
    worst = {"excluded": 0.0, "not excluded": 0.0}
    for t, (pose, truth) in enumerate(zip(path, truths, strict=True)):
        frame = paste(view(pose), target, *boxes[t][:2])
        motion = camera.update(frame, exclude=boxes[max(t - 1, 0)])
        worst["excluded"] = max(worst["excluded"], corner_error(motion.cur_from_prev, truth))
        motion = without_box.update(frame)
        worst["not excluded"] = max(
            worst["not excluded"], corner_error(motion.cur_from_prev, truth)
        )
    assert worst["excluded"] < 0.5
    assert worst["not excluded"] > 3.0


def with_overlays(frame):
    """A frame with a clock, a crosshair, a logo and rows of numbers."""
    image = frame.copy()
    for text, position in (
        ("2031-05-14 12:34:56", (12, 24)),
        ("ALT 120 m  SPD 14 m/s", (390, 24)),
        ("REC 00:12:33  ISO 400", (12, 348)),
    ):
        cv2.putText(image, text, position, cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 2)
    cv2.circle(image, (320, 180), 40, (0, 255, 0), 2)
    cv2.line(image, (250, 180), (390, 180), (0, 255, 0), 2)
    logo = generator(5).integers(0, 256, (6, 8, 3), np.uint8)
    image[40:100, 540:620] = cv2.resize(logo, (80, 60), interpolation=cv2.INTER_NEAREST)
    return image


def test_overlays_are_not_used():
    pale = (SCENE // 6 + 100).astype(np.uint8)  # a low-contrast scene under bright overlays
    path, truths = shaken(30, shift=6.0)
    camera = CameraMotion()
    errors = [
        corner_error(camera.update(with_overlays(view(pose, pale))).cur_from_prev, truth)
        for pose, truth in zip(path, truths, strict=True)
    ]
    assert max(errors[8:]) < 0.5


def test_water_is_not_used():
    """Half of the frame is replaced in every frame; the rest is the scene."""
    path, truths = shaken(8, shift=8.0)
    camera = CameraMotion()
    for t, (pose, truth) in enumerate(zip(path, truths, strict=True)):
        frame = view(pose)
        frame[190:] = world(seed=100 + t)[190:]
        assert corner_error(camera.update(frame).cur_from_prev, truth) < 0.5


def test_a_change_of_brightness_has_no_effect():
    truth = rigid(6, -4, 0.01, frame_center(SIZE))
    darker = (view(truth) * 0.8 + 25).astype(np.uint8)
    assert corner_error(between(view(np.eye(3)), darker).cur_from_prev, truth) < 0.3


def test_results_are_reproducible():
    path, _ = shaken(4, shift=8.0)
    first, second = (
        [camera.update(view(pose)).cur_from_prev for pose in path]
        for camera in (CameraMotion(), CameraMotion())
    )
    np.testing.assert_array_equal(first, second)
