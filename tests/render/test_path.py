"""`ScenePath`: poses chained from motions."""

import numpy as np
import pytest

from helpers.synthetic import generator, poses
from ssiam import Motion
from ssiam.geometry import frame_center, map_points, rigid
from ssiam.render import ScenePath

SIZE = (640, 360)
POINTS = [(0, 0), (639, 0), (320, 180), (10, 350)]


def motions_of(raw_from_scene):
    pairs = zip(raw_from_scene[1:], raw_from_scene[:-1], strict=True)
    motions = [Motion.from_transform(cur @ np.linalg.inv(prev), SIZE) for cur, prev in pairs]
    return [Motion.none(SIZE, reliable=True), *motions]


def zoomed(pose, zoom):
    x, y = frame_center(SIZE)
    return np.array([[zoom, 0, x - zoom * x], [0, zoom, y - zoom * y], [0, 0, 1]]) @ pose


def test_scene_is_the_first_frame_under_shift_rotation_and_zoom():
    r = generator(1)
    raw_from_scene = poses(r.normal(0, (20, 10, 0.1), (50, 3)), SIZE)
    zooms = np.exp(r.normal(0, 0.05, 50))
    raw_from_scene = [zoomed(p, z) for p, z in zip(raw_from_scene, zooms, strict=True)]
    start = np.linalg.inv(raw_from_scene[0])
    found = ScenePath(motions_of(raw_from_scene), SIZE).scene_from_raw()
    for pose, scene_from_raw in zip(raw_from_scene, found, strict=True):
        true = map_points(np.linalg.inv(pose @ start), POINTS)
        assert map_points(scene_from_raw, POINTS) == pytest.approx(true, abs=1e-6)


def test_long_path_keeps_its_precision():
    turn = Motion.from_transform(rigid(3.0, -1.0, 0.01, frame_center(SIZE)), SIZE)
    path = ScenePath([turn] * 20_001, SIZE)
    there = path.scene_from_raw()[19_999]
    back = path.scene_from_raw()[20_000]
    step = np.linalg.inv(back) @ there
    assert map_points(step, POINTS) == pytest.approx(
        map_points(turn.cur_from_prev, POINTS), abs=1e-6
    )


def test_unreliable_motions_are_interpolated():
    wild = Motion(rigid(900.0, 0, 1.0), 0.0, False, SIZE)
    slow, fast = (Motion.from_transform(rigid(-dx, 0, 0), SIZE) for dx in (4.0, 8.0))
    poses = ScenePath([wild, wild, slow, wild, fast, wild], SIZE).poses
    assert poses[:, 0] - frame_center(SIZE)[0] == pytest.approx([0, 4, 8, 14, 22, 30])
    assert poses[:, 1:] == pytest.approx(np.tile([frame_center(SIZE)[1], 0, 0], (6, 1)))


def test_path_of_unknown_motions_stays():
    assert ScenePath([Motion.none(SIZE)] * 4, SIZE).poses.std(axis=0) == pytest.approx([0] * 4)


def test_path_without_frames():
    assert len(ScenePath([], SIZE)) == 0
