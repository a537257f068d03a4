"""What the adapters for other people's trackers return, as those call them."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.host_scene import boxes, frames
from ssiam import CameraMotion, Motion
from ssiam.errors import ArgumentError
from ssiam.geometry import map_point, map_points, rigid
from ssiam.integrations import boxmot, norfair, roboflow_trackers, supervision, ultralytics
from ssiam.integrations.host_motion import HostMotion, SceneMotion

COUNT = 6


@pytest.fixture(scope="module")
def images():
    return frames()[:COUNT]


@pytest.fixture(scope="module")
def expected(images):
    """The motion with the boxes of the frame before excluded."""
    camera, before, found = CameraMotion(), None, []
    for image, xyxy in zip(images, boxes(), strict=False):
        motion = camera.update(image, None if before is None else before)
        before = np.hstack([xyxy[:, :2], xyxy[:, 2:] - xyxy[:, :2]])
        found.append(motion.cur_from_prev)
    return found


ADAPTERS = {
    "ultralytics": lambda: ultralytics.GMC().apply,
    "boxmot": lambda: boxmot.CMC().apply,
    "trackers": lambda: roboflow_trackers.CMC().estimate,
}


@pytest.mark.parametrize("name", ADAPTERS)
def test_the_boxes_of_a_frame_are_excluded_when_it_is_the_previous_one(images, expected, name):
    apply = ADAPTERS[name]()
    for image, xyxy, motion in zip(images, boxes(), expected, strict=False):
        found = apply(image, xyxy)
        assert found.shape == (2, 3)
        np.testing.assert_allclose(found, motion[:2], atol=1e-9)


@pytest.mark.parametrize("name", ADAPTERS)
def test_broken_boxes_are_ignored(images, expected, name):
    apply = ADAPTERS[name]()
    for image, xyxy, motion in zip(images, boxes(), expected, strict=False):
        broken = [(np.nan, 0, 1, 1), (0, 0, np.inf, 9), (9, 9, 3, 3), (4, 4, 4, 4)]
        found = apply(image, [*xyxy, *map(np.array, broken)])
        np.testing.assert_allclose(found, motion[:2], atol=1e-9)


@pytest.mark.parametrize("given", [None, [], np.empty((0, 4)), np.empty((0, 5))])
@pytest.mark.parametrize("name", ADAPTERS)
def test_without_boxes_the_whole_frame_is_used(images, name, given):
    apply, camera = ADAPTERS[name](), CameraMotion()
    for image in images[:3]:
        motion = camera.update(image)
        np.testing.assert_allclose(apply(image, given), motion.cur_from_prev[:2], atol=1e-9)


def test_rotated_boxes_of_boxmot_are_enclosed(images):
    turned, upright = boxmot.CMC(), boxmot.CMC()
    for image in images[:3]:
        found = turned.apply(image, np.array([[300, 180, 200, 60, np.pi / 2]]))
        expected = upright.apply(image, np.array([[270, 80, 330, 280]]))
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_another_frame_size_begins_again(images):
    motion = HostMotion()
    motion.update(images[0], [(0, 0, 639, 359)])
    for image in (images[1][:180, :320], images[2][:180, :320]):
        found = motion.update(image)
        assert found.size_wh == (320, 180)
    assert found.reliable
    np.testing.assert_array_equal(motion.update(images[3]).cur_from_prev, np.eye(3))


def test_gray_frames(images):
    for gray in ([image[..., 1] for image in images], [image[..., 1:2] for image in images]):
        motion = HostMotion()
        found = [motion.update(image) for image in gray]
        assert max(abs(each.shift_angle[0]) for each in found) > 10


@pytest.mark.parametrize("frame", [None, np.zeros((0, 5, 3), np.uint8), np.zeros((9, 9, 3))])
def test_what_is_no_image_is_refused_and_changes_nothing(images, frame):
    motion, twin = HostMotion(), HostMotion()
    motion.update(images[0])
    twin.update(images[0])
    with pytest.raises(ArgumentError):
        motion.update(frame, [(0, 0, 5, 5)])
    found, expected = motion.update(images[1]), twin.update(images[1])
    np.testing.assert_array_equal(found.cur_from_prev, expected.cur_from_prev)


def test_reset_forgets_the_frame(images):
    for adapter, reset in (
        (ultralytics.GMC(), "reset_params"),
        (boxmot.CMC(), "reset"),
        (roboflow_trackers.CMC(), "reset"),
    ):
        apply = getattr(adapter, "apply", None) or adapter.estimate
        apply(images[0], None)
        getattr(adapter, reset)()
        np.testing.assert_array_equal(apply(images[1], None), np.eye(2, 3))


def test_of_a_homography_the_affine_part_at_the_center_is_returned(images, monkeypatch):
    homography = np.array([[1.1, 0.02, 4], [-0.01, 0.98, -3], [2e-4, -1e-4, 1]])
    known = Motion.from_transform(homography, (640, 360))
    monkeypatch.setattr(CameraMotion, "update", lambda *_: known)
    affine = HostMotion().affine(images[0])
    step = 1e-4
    center = np.array([319.5, 179.5])
    around = center + step * np.array([[0, 0], [1, 0], [0, 1]])
    np.testing.assert_allclose(
        around @ affine[:, :2].T + affine[:, 2], map_points(homography, around), atol=1e-9
    )


@pytest.mark.parametrize("make", [SceneMotion, norfair.MotionEstimator])
def test_a_point_of_the_scene_stays_where_it_is(images, make):
    estimator = make()
    for image, xyxy in zip(images, boxes(), strict=False):
        found = estimator.update(image)
        centers = (xyxy[:, :2] + xyxy[:, 2:]) / 2
        still = (boxes()[0][:, :2] + boxes()[0][:, 2:]) / 2
        np.testing.assert_allclose(found.rel_to_abs(centers), still, atol=1)
        np.testing.assert_allclose(found.abs_to_rel(still), centers, atol=1)
        np.testing.assert_allclose(found.abs_to_rel(found.rel_to_abs((5, 6))), (5, 6))


def test_the_mask_of_norfair_excludes_boxes(images, expected):
    estimator, total = norfair.MotionEstimator(), np.eye(3)
    for image, xyxy, motion in zip(images, boxes(), expected, strict=False):
        mask = np.ones(image.shape[:2], np.uint8)
        for left, top, right, bottom in xyxy.round().astype(int):
            mask[top:bottom, left:right] = 0
        found, total = estimator.update(image, mask), motion @ total
        corner = map_point(total, 0, 0)
        np.testing.assert_allclose(found.abs_to_rel((0, 0)), corner, atol=0.2)


def test_a_scene_that_is_out_of_all_bounds_is_left(images, monkeypatch):
    shift = Motion.from_transform(rigid(150, 0, 0), (640, 360))
    monkeypatch.setattr(CameraMotion, "update", lambda *_: shift)
    scene, lefts = SceneMotion(), []
    for _ in range(5000):
        found = scene.update(images[0])
        lefts.append(found.abs_to_rel((0.0, 0.0))[0])
    assert np.isfinite(lefts).all()
    assert 600_000 < max(lefts) < 650_000  # a thousand frames
    assert lefts.count(0) > 1


def test_another_frame_size_begins_another_scene(images):
    scene = SceneMotion()
    scene.update(images[0])
    assert abs(scene.update(images[1]).abs_to_rel((0, 0))).max() > 1
    assert (scene.update(images[2][:180, :320]).abs_to_rel((3, 4)) == (3, 4)).all()


def test_copies_are_independent(images):
    scene = supervision.MotionEstimator()
    scene.update(images[0])
    twin = copy.copy(scene)
    expected = [scene.update(image).homography_matrix for image in images[1:3]]
    found = [twin.update(image).homography_matrix for image in images[1:3]]
    np.testing.assert_array_equal(found, expected)


def test_the_callback_of_ultralytics_replaces_what_is_there():
    own, without = SimpleNamespace(gmc=object()), SimpleNamespace()
    predictor = SimpleNamespace(trackers=[own, without])
    ultralytics.install(predictor)
    installed = own.gmc
    ultralytics.install(predictor)
    assert isinstance(installed, ultralytics.GMC)
    assert own.gmc is installed
    assert installed.method is not None
    assert vars(without) == {}
    ultralytics.install(SimpleNamespace())  # before it has trackers
