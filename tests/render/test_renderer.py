"""`Renderer`: the warp and its borders."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import Motion
from ssiam.errors import ArgumentError
from ssiam.geometry import rigid
from ssiam.render import CameraView, Renderer

SIZE = (320, 240)
SHIFTED = CameraView(rigid(20.0, 0.0, 0.0), SIZE)


def test_raw_view_is_not_copied():
    frame = world(size_wh=SIZE)
    assert Renderer("mirror").render(frame, CameraView.raw(SIZE)) is frame


def test_black_and_mirror_borders():
    frame = world(size_wh=SIZE)
    black = Renderer("black").render(frame, SHIFTED)
    mirror = Renderer("mirror").render(frame, SHIFTED)
    assert np.array_equal(black[:, 20:], frame[:, :-20])
    assert not black[:, :20].any()
    assert np.array_equal(mirror[:, :20], frame[:, 20:0:-1])


def test_image_has_the_size_of_the_view():
    view = CameraView(np.diag([0.5, 0.25, 1.0]), (160, 60))
    assert Renderer().render(world(size_wh=SIZE), view).shape == (60, 160, 3)


def test_homography_is_applied():
    tilted = np.eye(3)
    tilted[2, 0] = 1e-4
    frame = world(size_wh=SIZE)
    shown = Renderer("black").render(frame, CameraView(tilted, SIZE))
    assert np.array_equal(shown, cv2.warpPerspective(frame, tilted, SIZE))


def test_fill_shows_what_earlier_frames_showed():
    scene = world(size_wh=SIZE)
    raw_from_scene = poses(generator(3).normal(0, (8, 8, 0.01), (12, 3)), SIZE)
    raw_from_scene[0] = np.eye(3)
    renderer, mirrored = Renderer("fill"), Renderer("mirror")
    errors = []
    for index, pose in enumerate(raw_from_scene):
        frame = camera_frame(scene, pose)
        step = pose @ np.linalg.inv(raw_from_scene[max(index - 1, 0)])
        still = CameraView(np.linalg.inv(pose), SIZE)
        motion = Motion.from_transform(step, SIZE)
        shown = renderer.render(frame, still, motion), mirrored.render(frame, still)
        border = ~cv2.warpAffine(np.full(SIZE[::-1], 255, np.uint8), still.out_from_raw[:2], SIZE)
        at_border = border > 0
        at_border[:3] = at_border[-3:] = at_border[:, :3] = at_border[:, -3:] = False
        if index and at_border.any():
            errors.append(
                [np.abs(image[at_border] - 1.0 * scene[at_border]).mean() for image in shown]
            )
    filled, mirror = np.mean(errors, axis=0)
    assert filled < 0.35 * mirror


@pytest.mark.parametrize("motion", [None, Motion.none(SIZE)])
def test_fill_forgets_frames_that_are_not_related(motion):
    renderer = Renderer("fill")
    renderer.render(world(1, SIZE), CameraView.raw(SIZE), Motion.none(SIZE, reliable=True))
    frame = world(2, SIZE)
    shown = renderer.render(frame, SHIFTED, motion)
    assert np.array_equal(shown, Renderer("mirror").render(frame, SHIFTED))


def test_unknown_border():
    with pytest.raises(ArgumentError, match="border"):
        Renderer("white")
