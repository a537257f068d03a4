"""`model="mesh"`: the motion at a point of a scene with depth."""

import numpy as np
import pytest

import ssiam
from helpers.synthetic import camera_frame, generator, world
from ssiam import ArgumentError, CameraMotion, Motion
from ssiam.geometry import map_point, rigid
from ssiam.motion.mesh import MotionMesh
from ssiam.stabilize import PredictConfig, TargetPredictor

SIZE = (640, 360)
FAR, NEAR = world(21, SIZE), world(22, SIZE)
NEAR_PARALLAX = 4.0  # px per frame by which the near half moves further


def frame(number, near_from=200):
    """A camera that moves sideways: below row `near_from` the ground is nearer."""
    shift = rigid(3.0 * number, 0, 0)
    image = camera_frame(FAR, shift)
    near = camera_frame(NEAR, rigid(NEAR_PARALLAX * number, 0, 0) @ shift)
    image[near_from:] = near[near_from:]
    return image


def motion_between(model, exclude=None, near_from=200):
    camera = CameraMotion(model=model)
    camera.update(frame(0, near_from))
    return camera.update(frame(1, near_from), exclude)


@pytest.mark.parametrize("exclude", [None, (280, 230, 60, 90)])
def test_near_and_far_background_move_differently(exclude):
    plain, mesh = motion_between("similarity", exclude), motion_between("mesh", exclude)
    points = {(320, 60): 3.0, (310, 300): 3.0 + NEAR_PARALLAX}
    errors = {
        motion: max(abs(map_point(motion.at(p), *p)[0] - p[0] - dx) for p, dx in points.items())
        for motion in (plain, mesh)
    }
    assert errors[plain] > 1.5
    assert errors[mesh] < 0.7


def test_without_depth_the_mesh_is_flat():
    camera = CameraMotion(model="mesh")
    camera.update(FAR)
    motion = camera.update(camera_frame(FAR, rigid(6, -4, 0.02, (320, 180))))
    assert np.abs(motion.mesh.shifts_xy).max() < 0.15


def test_a_mesh_without_texture_is_flat():
    """Noise of one gray level has no motion of its own."""
    noise = generator(1)
    camera = CameraMotion(model="mesh")
    frames = [np.full((360, 640, 3), 90, np.uint8) + noise.integers(0, 2, (360, 640, 1), np.uint8)]
    camera.update(frames[0])
    assert camera.update(frames[0]).mesh is None  # blank
    image = FAR.copy()
    image[:, 320:] = 90
    camera = CameraMotion(model="mesh")
    camera.update(image)
    assert np.abs(camera.update(image).mesh.shifts_xy).max() < 0.05


def test_shifts_are_interpolated_and_continued_outside():
    shifts = np.zeros((2, 2, 2))
    shifts[0, 1] = 8, -4
    mesh = MotionMesh(shifts, (10.0, 20.0, 100.0, 50.0))
    assert mesh.shift_at((60, 20)) == pytest.approx((4, -2))
    assert mesh.shift_at((60, 45)) == pytest.approx((2, -1))
    assert mesh.shift_at((500, -9)) == pytest.approx((8, -4))
    assert mesh.moved((5, 7)).shift_at((65, 27)) == pytest.approx((4, -2))


def test_the_motion_at_a_point_without_a_mesh():
    motion = Motion.from_transform(rigid(1, 2, 0.1), SIZE)
    assert motion.at((5, 5)) is motion.cur_from_prev


def test_letterbox_bars_move_the_mesh():
    barred = [np.zeros((440, 640, 3), np.uint8) for _ in range(2)]
    for number, image in enumerate(barred):
        image[40:400] = frame(number)
    camera = CameraMotion(model="mesh")
    camera.update(barred[0])
    moved = camera.update(barred[1])
    assert map_point(moved.at((310, 340)), 310, 340)[0] == pytest.approx(317, abs=0.7)


def test_the_prediction_uses_the_motion_at_the_target():
    shifts = np.zeros((2, 2, 2))
    shifts[1] = 9, 0
    mesh = MotionMesh(shifts, (0.0, 0.0, 640.0, 360.0))
    motion = Motion(rigid(3, 0, 0), 1.0, True, SIZE, mesh)
    predictor = TargetPredictor(PredictConfig(), (300.0, 340.0, 40.0, 40.0))
    assert predictor.update(motion)[0] == pytest.approx(312)
    assert motion.map_box((300.0, 340.0, 40.0, 40.0)) == pytest.approx((312, 340, 40, 40))


def test_a_tracker_estimates_the_mesh_of_its_config():
    tracker = ssiam.load_tracker("kcf", stabilize=ssiam.StabilizerConfig(motion_model="mesh"))
    tracker.init(frame(0), (300, 40, 40, 40))
    assert tracker.update(frame(1)).motion.mesh is not None
    tracker.switch(ssiam.StabilizerConfig(), frame(1))
    assert tracker.update(frame(2)).motion.mesh is None


def test_a_mesh_needs_direct_alignment():
    with pytest.raises(ArgumentError, match="model \"mesh\" is given with keypoints 'orb'"):
        CameraMotion("orb", model="mesh")
