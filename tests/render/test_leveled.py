from __future__ import annotations

import numpy as np

from ssiam.datasets import Shake
from ssiam.datasets.shake import camera_path
from ssiam.geometry import map_point, rigid
from ssiam.motion import Motion
from ssiam.render.leveled import leveled_path

SIZE_WH = 640, 360


def _motions(shaken_from_raw: np.ndarray) -> list[Motion]:
    steps = shaken_from_raw[1:] @ np.linalg.inv(shaken_from_raw[:-1])
    return [Motion.from_transform(each, SIZE_WH) for each in (np.eye(3), *steps)]


def test_a_point_of_the_scene_stays_under_shake() -> None:
    poses = camera_path(Shake(0.03), 150, SIZE_WH)
    scene_from_raw = leveled_path(_motions(poses), 120).scene_from_raw()
    points = np.array(
        [
            map_point(matrix, *map_point(pose, 350.0, 150.0))
            for matrix, pose in zip(scene_from_raw, poses, strict=True)
        ]
    )
    in_frames = np.array([map_point(pose, 350.0, 150.0) for pose in poses])
    assert points.std(axis=0).max() < 0.05 * in_frames.std(axis=0).min()


def test_long_rolls_and_zooms_are_kept() -> None:
    turning = np.stack([rigid(0, 0, 0.01 * t, (319.5, 179.5)) for t in range(300)])
    path = leveled_path(_motions(turning), 120)
    assert np.abs(path.roll).max() < 0.01
    assert np.abs(path.log_zoom).max() < 1e-9


def test_unreliable_motions_and_the_first_one_do_not_count() -> None:
    shift = Motion.from_transform(rigid(5, 0, 0), SIZE_WH)
    unknown = Motion(rigid(70, 0, 0.1), 0.0, False, SIZE_WH)
    path = leveled_path([shift, shift, unknown, shift], 120)
    np.testing.assert_allclose(np.diff(path.origin_xy[:, 0]), [-5, 0, -5])
