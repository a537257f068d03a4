"""Gray frames, such as the luma planes of decoders and the frames of mono cameras."""

import cv2
import numpy as np
import pytest

from helpers.synthetic import camera_frame, poses, world
from ssiam import CameraMotion
from ssiam.errors import ArgumentError, FrameSizeError
from ssiam.motion import PrefetchingCameraMotion

SIZE = (320, 240)
PATH = [(0, 0, 0), (5, -3, 0.02), (1, 4, -0.01), (-6, 2, 0.03)]


def colored(size_wh=SIZE):
    return [camera_frame(world(4, size_wh), pose) for pose in poses(PATH, size_wh)]


def gray(frame):
    return cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)


def luma(frame):
    """As in most video files: 16 is black and 235 white."""
    return np.rint(gray(frame) * (219 / 255) + 16).astype(np.uint8)


def transforms(frames, **options):
    camera = CameraMotion(**options)
    motions = [camera.update(frame) for frame in frames]
    assert all(motion.reliable for motion in motions)
    return np.array([motion.cur_from_prev for motion in motions])


@pytest.mark.parametrize("convert", [gray, luma])
def test_the_motion_is_that_of_the_colored_frames(convert):
    frames = colored()
    expected = transforms(frames)
    found = transforms([convert(frame) for frame in frames])
    np.testing.assert_allclose(found, expected, atol=0.1)
    assert abs(expected[1][0, 2]) > 3, "or the test shows nothing"


def test_the_kernel_and_numpy_agree_on_gray_frames(monkeypatch):
    frames = [luma(frame) for frame in colored()]
    found = transforms(frames)
    monkeypatch.setenv("SSIAM_KERNEL", "numpy")
    np.testing.assert_allclose(transforms(frames), found, atol=1e-3)


@pytest.mark.parametrize("keypoints", ["gftt", "orb"])
def test_keypoints_of_gray_frames(keypoints):
    frames = colored()
    found = transforms([gray(frame) for frame in frames], keypoints=keypoints)
    np.testing.assert_array_equal(found, transforms(frames, keypoints=keypoints))


def test_gray_and_colored_frames_may_follow_each_other():
    frames = colored()
    mixed = [gray(frame) if index % 2 else frame for index, frame in enumerate(frames)]
    np.testing.assert_allclose(transforms(mixed), transforms(frames), atol=0.1)


def test_a_plane_with_padded_rows_needs_no_copy():
    frames = colored()
    planes = [np.pad(luma(frame), ((0, 0), (0, 64)))[:, : SIZE[0]] for frame in frames]
    assert not planes[0].flags.c_contiguous
    plain = [np.ascontiguousarray(plane) for plane in planes]
    np.testing.assert_array_equal(transforms(planes), transforms(plain))


def test_bars_of_gray_frames_are_cut():
    frames = [np.pad(luma(frame), ((60, 60), (0, 0)), constant_values=16) for frame in colored()]
    camera = CameraMotion()
    motions = [camera.update(frame) for frame in frames]
    assert motions[1].shift_angle == pytest.approx(PATH[1], abs=0.3)


def test_a_gray_frame_in_another_thread():
    frames = [gray(frame) for frame in colored()]
    camera = PrefetchingCameraMotion(CameraMotion())
    camera.update(frames[0])
    camera.start(frames[1])
    given = np.eye(3)
    assert camera.update(frames[1], motion=given).shift_angle == (0, 0, 0)


@pytest.mark.parametrize("frame", [np.zeros((4, 4), float), np.zeros((0, 4), np.uint8)])
def test_other_gray_frames_are_refused(frame):
    with pytest.raises(ArgumentError, match="frame"):
        CameraMotion().update(frame)


def test_a_gray_frame_of_another_size_is_refused():
    camera = CameraMotion()
    camera.update(colored()[0])
    with pytest.raises(FrameSizeError, match="frame of 160x120 pixels after frames of 320x240"):
        camera.update(gray(colored()[0])[::2, ::2])
