"""`ssiam.integrations.norfair` in norfair's tracker."""

import numpy as np
import pytest

from helpers import host_scene
from ssiam.integrations.norfair import MotionEstimator

norfair = pytest.importorskip("norfair", exc_type=ImportError)


def identities(estimator):
    tracker = norfair.Tracker(
        distance_function="iou", distance_threshold=0.7, initialization_delay=1
    )
    for number, (frame, boxes) in enumerate(
        zip(host_scene.frames(), host_scene.boxes(), strict=True)
    ):
        mask = np.ones(frame.shape[:2], np.uint8)
        for left, top, right, bottom in np.maximum(boxes, 0).astype(int):
            mask[top:bottom, left:right] = 0
        found = [
            norfair.Detection(box.reshape(2, 2), data=(number, index))
            for index, box in enumerate(boxes)
        ]
        moved = estimator.update(frame, mask) if estimator else None
        targets = tracker.update(found, coord_transformations=moved)
        seen = [(target.last_detection.data, target.id) for target in targets]
        yield host_scene.by_index((data[1], one) for data, one in seen if data[0] == number)


def test_identities_are_kept_while_the_camera_shakes():
    host_scene.assert_kept(list(identities(MotionEstimator())))
    host_scene.assert_not_kept(list(identities(None)))


def test_the_path_of_a_fixed_point_is_drawn_where_it_is():
    frames, boxes = host_scene.frames(), host_scene.boxes()
    estimator = MotionEstimator()
    for frame in frames:
        moved = estimator.update(frame)
    first, last = (each.reshape(-1, 2, 2).mean(axis=1) for each in (boxes[0], boxes[-1]))
    np.testing.assert_allclose(moved.rel_to_abs(last), first, atol=3)
    np.testing.assert_allclose(moved.abs_to_rel(first), last, atol=3)
    camera = norfair.FixedCamera(scale=2)
    assert camera.adjust_frame(frames[-1], moved).shape == (720, 1280, 3)


def test_hostile_frames_do_not_end_the_loop():
    tracker = norfair.Tracker(distance_function="iou", distance_threshold=0.7)
    estimator = MotionEstimator()
    for frame in host_scene.hostile(host_scene.frames()[0]):
        moved = estimator.update(frame, np.zeros(frame.shape[:2], np.uint8))
        found = [norfair.Detection(np.array([[10.0, 10], [40, 40]]))]
        for target in tracker.update(found, coord_transformations=moved):
            assert np.isfinite(target.estimate).all()


def test_the_example_of_the_documentation_runs():
    scope = host_scene.run_example("norfair")
    assert np.isfinite(scope["moved"].abs_to_rel([[1, 2]])).all()
