"""`ssiam.integrations.supervision` with supervision's detections and zones."""

import numpy as np
import pytest

from helpers import host_scene
from ssiam.integrations.supervision import MotionEstimator, SceneTracker

sv = pytest.importorskip("supervision", exc_type=ImportError)


def detections(boxes):
    return sv.Detections(
        xyxy=np.reshape(boxes, (-1, 4)).astype(np.float32),
        confidence=np.full(len(boxes), 0.9, np.float32),
        class_id=np.zeros(len(boxes), int),
        data={"index": np.arange(len(boxes))},
    )


def identities(update):
    for frame, boxes in zip(host_scene.frames(), host_scene.boxes(), strict=True):
        found = update(frame, detections(boxes))
        pairs = zip(found.data.get("index", ()), found.tracker_id, strict=False)
        yield host_scene.by_index((index, one) for index, one in pairs if one >= 0)


@pytest.mark.parametrize("kind", ["ByteTrackTracker", "SORTTracker", "OCSORTTracker"])
def test_trackers_without_camera_motion_keep_identities(kind):
    make = getattr(host_scene.roboflow_trackers(), kind)
    host_scene.assert_kept(list(identities(SceneTracker(make().update).update)))
    alone = make()
    host_scene.assert_not_kept(list(identities(lambda frame, found: alone.update(found))))


def test_a_line_counts_nothing_that_stands_still():
    """The line is beside a column of boxes, which cross it again and again in the frame."""
    crossings = {}
    for name, estimator in (("alone", None), ("scene", MotionEstimator())):
        line = sv.LineZone(sv.Point(275, 0), sv.Point(275, 360), [sv.Position.CENTER])
        for frame, boxes in zip(host_scene.frames(), host_scene.boxes(), strict=True):
            found = detections(boxes)
            found.tracker_id = np.arange(len(boxes))
            moved = estimator and estimator.update(frame, found.xyxy)
            line.trigger(found, coord_transform=moved)
        crossings[name] = line.in_count + line.out_count
    assert crossings["alone"] > 10
    assert crossings["scene"] == 0


def test_boxes_come_back_where_they_were():
    tracker = SceneTracker(lambda found: found)
    for frame, boxes in zip(host_scene.frames()[:6], host_scene.boxes(), strict=False):
        broken = np.vstack([boxes, (np.nan, 1, 2, 3), (5, 5, 5, 9)])
        given = detections(np.nan_to_num(broken))
        given.xyxy = broken.astype(np.float32)  # checked by newer versions only when it is made
        found = tracker.update(frame, given)
        np.testing.assert_allclose(found.xyxy, [*boxes, (5, 5, 5, 9)], atol=1e-3)
        assert found.data["index"].tolist() == [*range(len(boxes)), len(boxes) + 1]


def test_hostile_frames_do_not_end_the_loop():
    estimator, tracker = MotionEstimator(), SceneTracker(lambda found: found)
    for frame in host_scene.hostile(host_scene.frames()[0]):
        for boxes in ([(10, 10, 40, 40)], []):
            assert np.isfinite(tracker.update(frame, detections(boxes)).xyxy).all()
        assert np.isfinite(estimator.update(frame).rel_to_abs([[1, 2]])).all()


def test_the_example_of_the_documentation_runs():
    host_scene.roboflow_trackers()
    scope = host_scene.run_example("supervision")
    assert np.isfinite(scope["tracked"].xyxy).all()
