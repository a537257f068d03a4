"""`ssiam.integrations.ultralytics` in the trackers of ultralytics, without a network."""

from types import SimpleNamespace

import numpy as np
import pytest

from helpers import host_scene
from ssiam.integrations.ultralytics import GMC, install

trackers = pytest.importorskip("ultralytics.trackers.track", exc_type=ImportError)
results = pytest.importorskip("ultralytics.engine.results", exc_type=ImportError)

KINDS = ("botsort", "deepocsort", "tracktrack")


def tracker_of(kind, **changes):
    settings = trackers.YAML.load(trackers.check_yaml(f"{kind}.yaml")) | changes
    return trackers.TRACKER_MAP[kind](trackers.IterableSimpleNamespace(**settings))


def detections(boxes, frame):
    rows = [(*box, 0.9, 0) for box in boxes]
    return results.Boxes(np.reshape(rows, (-1, 6)).astype(np.float32), frame.shape[:2])


def identities(tracker):
    for frame, boxes in zip(host_scene.frames(), host_scene.boxes(), strict=True):
        tracks = tracker.update(detections(boxes, frame), frame)
        yield host_scene.by_index((row[-1], row[4]) for row in tracks)


@pytest.mark.parametrize("kind", KINDS)
def test_identities_are_kept_while_the_camera_shakes(kind):
    tracker = tracker_of(kind)
    install(SimpleNamespace(trackers=[tracker]))
    assert isinstance(tracker.gmc, GMC)
    host_scene.assert_kept(list(identities(tracker)))
    tracker.reset()
    host_scene.assert_kept(list(identities(tracker)))


def test_without_a_motion_they_are_not():
    host_scene.assert_not_kept(list(identities(tracker_of("botsort", gmc_method="none"))))


def test_a_tracker_without_camera_motion_is_left_alone():
    tracker, botsort = tracker_of("bytetrack"), tracker_of("botsort")
    predictor = SimpleNamespace(trackers=[tracker, botsort])
    install(predictor)
    installed = botsort.gmc
    install(predictor)  # the callback is called for each batch
    assert botsort.gmc is installed
    assert not hasattr(tracker, "gmc")


@pytest.mark.parametrize("kind", KINDS)
def test_hostile_frames_do_not_end_the_loop(kind):
    tracker = tracker_of(kind)
    tracker.gmc = GMC()
    for frame in host_scene.hostile(host_scene.frames()[0]):
        tracks = tracker.update(detections([(10, 10, 40, 40)], frame), frame)
        assert np.isfinite(np.asarray(tracks, np.float64)).all()
        tracker.update(detections([], frame), frame)


def test_the_example_of_the_documentation_runs():
    scope = host_scene.run_example("ultralytics")
    assert np.isfinite(scope["tracks"]).all()
