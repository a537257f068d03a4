"""Stabilized views: planned for a whole clip, and without delay."""

import copy
import pickle
from itertools import pairwise

import numpy as np
import pytest

from helpers.synthetic import generator, poses
from ssiam import Motion
from ssiam.errors import FrameSizeError
from ssiam.geometry import map_points, rigid
from ssiam.render import (
    CameraView,
    Crop,
    ScenePath,
    ShakeMeter,
    StabilizedCamera,
    stabilized_views,
)

SIZE = (640, 360)
FPS = 30.0
COUNT = 240
PAN = (4.0, 0.0)  # px per frame


def shaken_motions(*, shift=6.0, angle=0.01, pan=PAN, count=COUNT, seed=4):
    """Motions of a camera that pans steadily and shakes."""
    shake = poses(generator(seed).normal(0, (shift, shift, angle), (count, 3)), SIZE)
    path = [pose @ rigid(-k * pan[0], -k * pan[1], 0.0) for k, pose in enumerate(shake)]
    steps = [b @ np.linalg.inv(a) for a, b in pairwise(path)]
    return [Motion.none(SIZE, reliable=True), *(Motion.from_transform(s, SIZE) for s in steps)]


def planned(motions, **options):
    return stabilized_views(ScenePath(motions, SIZE), FPS, **options)


def live(motions, **options):
    camera = StabilizedCamera(SIZE, FPS, **options)
    return [camera.update(motion) for motion in motions], camera.share


def out_motions(motions, views):
    triples = zip(motions[1:], views[:-1], views[1:], strict=True)
    return [
        cur.out_from_raw @ motion.cur_from_prev @ np.linalg.inv(prev.out_from_raw)
        for motion, prev, cur in triples
    ]


def shake_of(motions):
    meter = ShakeMeter(FPS)
    for motion in motions:
        meter.add(motion, SIZE)
    return meter.px_per_frame


def raw_shake(motions):
    return shake_of([motion.cur_from_prev for motion in motions[1:]])


@pytest.mark.parametrize(("stabilize", "most"), [(planned, 0.02), (live, 0.15)])
def test_shake_is_removed_and_a_pan_kept(stabilize, most):
    motions = shaken_motions()
    views, share = stabilize(motions)
    moved = out_motions(motions, views)
    assert shake_of(moved) < most * raw_shake(motions)
    center = np.array([map_points(m, [(320, 180)])[0] - (320, 180) for m in moved])
    zoom = 1 / (1 - share)
    assert center[60:].mean(axis=0) == pytest.approx((-PAN[0] * zoom, 0), abs=0.6)


@pytest.mark.parametrize("stabilize", [planned, live])
def test_border_is_hidden(stabilize):
    motions = shaken_motions(shift=12.0)
    views, share = stabilize(motions)
    filled = [view.is_filled_by(SIZE) for view in views]
    assert np.mean(filled) >= 0.98
    assert share <= 0.15
    assert {view.size_wh for view in views} == {SIZE}


@pytest.mark.parametrize("stabilize", [planned, live])
def test_unreliable_motions_do_not_break_the_path(stabilize):
    motions = shaken_motions()
    for index in (50, 51, 120):
        motions[index] = Motion(rigid(500.0, 400.0, 1.0), 0.0, False, SIZE)
    views, _ = stabilize(motions)
    assert len(views) == COUNT
    assert all(np.isfinite(view.out_from_raw).all() for view in views)
    assert np.mean([view.is_filled_by(SIZE) for view in views]) >= 0.98


@pytest.mark.parametrize("stabilize", [planned, live])
def test_camera_at_rest_is_shown_as_it_is(stabilize):
    views, share = stabilize([Motion.none(SIZE, reliable=True)] * 40, crop=Crop(0.0))
    assert share == 0
    for view in views:
        assert view.out_from_raw == pytest.approx(np.eye(3), abs=1e-9)


@pytest.mark.parametrize("stabilize", [planned, live])
def test_given_share_is_cropped(stabilize):
    views, share = stabilize(shaken_motions(), crop=Crop(0.2))
    assert share == 0.2
    for view in views:
        zoom = np.sqrt(np.linalg.det(view.out_from_raw[:2, :2]))
        assert zoom == pytest.approx(1 / 0.8, rel=0.03)


def test_little_shake_needs_little_crop():
    _, share = planned(shaken_motions(shift=1.0, angle=0.001))
    assert 0 < share < 0.05


def test_sudden_jerk_stays_within_the_crop_and_is_spread_over_frames():
    motions = [Motion.none(SIZE, reliable=True)] * COUNT
    motions[100] = Motion.from_transform(rigid(150.0, 0, 0), SIZE)
    views, share = planned(motions, crop=Crop(0.15))
    assert all(view.is_filled_by(SIZE) for view in views)
    moved = np.array([m[0, 2] for m in out_motions(motions, views)])
    assert abs(moved).max() < 100 / (1 - share)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_short_clips(count):
    views, _ = planned(shaken_motions(count=max(count, 1))[:count])
    assert len(views) == count


def test_live_camera_refuses_other_frames():
    camera = StabilizedCamera(SIZE, FPS)
    with pytest.raises(FrameSizeError, match="640x360"):
        camera.update(Motion.none((320, 240), reliable=True))


def test_live_camera_and_its_copy_are_independent():
    motions = shaken_motions(count=40)
    camera = StabilizedCamera(SIZE, FPS)
    for motion in motions[:20]:
        camera.update(motion)
    twin = copy.copy(camera)
    pickled = pickle.loads(pickle.dumps(camera))
    expected = [camera.update(motion).out_from_raw.tolist() for motion in motions[20:]]
    for other in (twin, pickled):
        assert [other.update(motion).out_from_raw.tolist() for motion in motions[20:]] == expected


def test_live_camera_needs_no_later_frames():
    motions = shaken_motions()
    views, _ = live(motions)
    shorter, _ = live(motions[:100])
    for view, same in zip(views[:100], shorter, strict=True):
        assert np.array_equal(view.out_from_raw, same.out_from_raw)


def test_meter_ignores_a_steady_pan():
    assert shake_of([rigid(8.0, 3.0, 0.0)] * 90) == pytest.approx(0, abs=1e-9)
    assert shake_of([rigid(8.0, 3.0, 0.0)] * 5) == pytest.approx(0, abs=1e-9)
    alternating = [rigid(8.0 + 5 * (-1) ** k, 0, 0) for k in range(90)]
    assert shake_of(alternating) == pytest.approx(5, rel=0.05)
    assert ShakeMeter(FPS).px_per_frame == 0


def test_raw_view_is_the_frame():
    view = CameraView.raw(SIZE)
    assert view.is_filled_by(SIZE)
    assert not view.is_filled_by((640, 350))
