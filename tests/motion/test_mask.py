"""A mask of what moves with the camera."""

import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import CameraMotion
from ssiam.errors import ArgumentError

SIZE = (640, 360)
SCENE = world(3, SIZE)
HOOD = np.zeros((360, 640), bool)
HOOD[150:, 40:600] = True


def frames(count=3):
    """A strongly textured hood covers half of the frame, over a pale scene that moves by 9 px."""
    hood = np.kron(generator(2).integers(0, 256, (45, 80, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    moved = poses([(9.0 * index, 0, 0) for index in range(count)], SIZE)
    pale = [camera_frame(SCENE, pose) // 4 + 90 for pose in moved]
    return [np.where(HOOD[..., None], hood, frame).astype(np.uint8) for frame in pale]


def shift(camera, clip):
    camera.update(clip[0])
    motion = camera.update(clip[1])
    return motion.shift_angle[0] if motion.reliable else None


@pytest.mark.parametrize("mask", [HOOD, HOOD.astype(np.uint8), 255 * HOOD.astype(np.uint8)])
def test_masked_pixels_are_not_used(mask):
    clip = frames()
    assert shift(CameraMotion(), clip) != pytest.approx(9, abs=1), "or the test shows nothing"
    assert shift(CameraMotion(mask=mask), clip) == pytest.approx(9, abs=0.3)


def test_the_mask_is_cut_as_the_frames_are():
    """Bars at the left and the right side; the mask is of the whole frames."""
    clip = [np.pad(frame, ((0, 0), (120, 120), (0, 0))) for frame in frames()]
    mask = np.pad(HOOD, ((0, 0), (120, 120)))
    assert shift(CameraMotion(mask=mask), clip) == pytest.approx(9, abs=0.3)


def test_an_empty_mask_changes_nothing():
    clip = frames()
    plain, masked = CameraMotion(), CameraMotion(mask=np.zeros_like(HOOD))
    for frame in clip:
        np.testing.assert_array_equal(
            plain.update(frame).cur_from_prev, masked.update(frame).cur_from_prev
        )


def test_a_whole_mask_leaves_no_motion():
    clip = frames()
    assert shift(CameraMotion(mask=np.ones_like(HOOD)), clip) is None


@pytest.mark.parametrize(
    "mask", [HOOD.astype(float), HOOD[..., None], np.zeros((0, 5), bool), "hood", 3, [1.0, 2.0]]
)
def test_what_is_no_mask_is_refused(mask):
    with pytest.raises(ArgumentError, match=r"^mask is .*: give a \(height, width\) array"):
        CameraMotion(mask=mask)


def test_a_mask_of_another_size_is_refused_before_anything_changes():
    camera = CameraMotion(mask=HOOD)
    with pytest.raises(ArgumentError, match="the mask has 640x360 pixels: give one of 320x180"):
        camera.update(frames()[0][::2, ::2])
    assert shift(camera, frames()) == pytest.approx(9, abs=0.3)


def test_keypoints_take_no_mask():
    with pytest.raises(ArgumentError, match="mask is given with keypoints 'orb'"):
        CameraMotion("orb", mask=HOOD)
