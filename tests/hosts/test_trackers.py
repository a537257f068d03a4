"""`ssiam.integrations.roboflow_trackers` in roboflow's trackers."""

import numpy as np
import pytest

from helpers import host_scene
from ssiam.integrations.roboflow_trackers import CMC, MotionEstimator

trackers = host_scene.roboflow_trackers()
sv = pytest.importorskip("supervision", exc_type=ImportError)


def detections(boxes):
    return sv.Detections(
        xyxy=np.reshape(boxes, (-1, 4)).astype(np.float32),
        confidence=np.full(len(boxes), 0.9, np.float32),
        class_id=np.zeros(len(boxes), int),
        data={"index": np.arange(len(boxes))},
    )


def identities(tracker):
    for frame, boxes in zip(host_scene.frames(), host_scene.boxes(), strict=True):
        found = tracker.update(detections(boxes), frame)
        pairs = zip(found.data.get("index", ()), found.tracker_id, strict=False)
        yield host_scene.by_index((index, one) for index, one in pairs if one >= 0)


def test_identities_are_kept_while_the_camera_shakes():
    tracker = trackers.BoTSORTTracker()
    tracker.cmc = CMC()
    host_scene.assert_kept(list(identities(tracker)))
    tracker.reset()
    host_scene.assert_kept(list(identities(tracker)))
    host_scene.assert_not_kept(list(identities(trackers.BoTSORTTracker(enable_cmc=False))))


def test_traces_are_drawn_in_the_scene():
    estimator, annotator = MotionEstimator(), trackers.MotionAwareTraceAnnotator()
    still = None
    for frame, boxes in zip(host_scene.frames(), host_scene.boxes(), strict=True):
        found = detections(boxes)
        found.tracker_id = np.arange(len(boxes))
        moved = estimator.update(frame)
        scene = moved.rel_to_abs(found.get_anchors_coordinates(sv.Position.CENTER))
        still = scene if still is None else still
        np.testing.assert_allclose(scene, still, atol=3)
        drawn = annotator.annotate(frame.copy(), found, coord_transform=moved)
        assert drawn.shape == frame.shape


def test_hostile_frames_do_not_end_the_loop():
    tracker, estimator = trackers.BoTSORTTracker(), MotionEstimator()
    tracker.cmc = CMC()
    for frame in host_scene.hostile(host_scene.frames()[0]):
        for boxes in ([(10, 10, 40, 40)], []):
            assert np.isfinite(tracker.update(detections(boxes), frame).xyxy).all()
        assert np.isfinite(estimator.update(frame).rel_to_abs([[1, 2]])).all()


def test_the_example_of_the_documentation_runs():
    scope = host_scene.run_example("roboflow_trackers")
    assert np.isfinite(scope["moved"].abs_to_rel([[1, 2]])).all()
