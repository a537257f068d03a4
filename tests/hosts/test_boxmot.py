"""`ssiam.integrations.boxmot` in the trackers of boxmot, without a network."""

import numpy as np
import pytest

from helpers import host_scene
from ssiam.integrations.boxmot import CMC

botsort = pytest.importorskip("boxmot.trackers.box.botsort.tracker", exc_type=ImportError)


def rows(boxes):
    return np.reshape([(*box, 0.9, 0) for box in boxes], (-1, 6)).astype(np.float32)


def identities(tracker):
    for frame, boxes in zip(host_scene.frames(), host_scene.boxes(), strict=True):
        tracks = np.asarray(tracker.update(rows(boxes), frame))
        yield host_scene.by_index((row[7], row[4]) for row in tracks)


def test_identities_are_kept_while_the_camera_shakes():
    tracker = botsort.BotSort(use_embeddings=False)
    tracker.cmc = CMC()
    host_scene.assert_kept(list(identities(tracker)))
    tracker.reset()
    host_scene.assert_kept(list(identities(tracker)))
    host_scene.assert_not_kept(
        list(identities(botsort.BotSort(use_embeddings=False, use_cmc=False)))
    )


def test_hostile_frames_do_not_end_the_loop():
    tracker = botsort.BotSort(use_embeddings=False)
    tracker.cmc = CMC()
    for frame in host_scene.hostile(host_scene.frames()[0]):
        for boxes in ([(10, 10, 40, 40)], []):
            assert np.isfinite(np.asarray(tracker.update(rows(boxes), frame))).all()


def test_rotated_boxes():
    tracker = botsort.BotSort(use_embeddings=False, is_obb=True)
    tracker.cmc = CMC()
    for frame in host_scene.frames()[:5]:
        found = np.array([[320, 180, 60, 20, 0.5, 0.9, 0]], np.float32)
        assert np.isfinite(np.asarray(tracker.update(found, frame))).all()


def test_the_example_of_the_documentation_runs():
    scope = host_scene.run_example("boxmot")
    assert np.isfinite(scope["tracks"]).all()
