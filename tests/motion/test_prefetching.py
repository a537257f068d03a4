import time
from copy import deepcopy

import numpy as np
import pytest

from helpers.synthetic import camera_frame, generator, poses, world
from ssiam import CameraMotion, FrameSizeError
from ssiam.geometry import rigid
from ssiam.motion import PrefetchingCameraMotion

SIZE = (320, 240)
BOX = (100.0, 80.0, 40.0, 40.0)


def shaken(count=8):
    scene = world(size_wh=SIZE)
    path = poses(generator(3).normal(0, (6, 6, 0.01), (count, 3)), SIZE)
    return [camera_frame(scene, pose) for pose in path]


def prefetching(keypoints="direct"):
    return PrefetchingCameraMotion(CameraMotion(keypoints))


@pytest.mark.parametrize("keypoints", ["direct", "orb"])
@pytest.mark.parametrize("started", [range(8), range(0, 8, 2), [], [1], [7]])
def test_motions_equal_those_of_the_camera_alone(keypoints, started):
    alone, camera = CameraMotion(keypoints), prefetching(keypoints)
    for number, frame in enumerate(shaken()):
        box = tuple(np.add(BOX, (3 * number, 0, 0, 0)))
        if number in started:
            camera.start(frame, exclude=box)
        expected = alone.update(frame, exclude=box)
        found = camera.update(frame, exclude=box)
        np.testing.assert_array_equal(found.cur_from_prev, expected.cur_from_prev)
        assert (found.reliable, found.inliers) == (expected.reliable, expected.inliers)
        assert found.size_wh == SIZE


def test_a_given_motion_is_returned():
    camera = prefetching()
    first, second, *_ = shaken()
    camera.update(first)
    given = rigid(5, 4, 0.1)
    np.testing.assert_allclose(camera.update(second, motion=given).cur_from_prev, given)


def test_a_given_motion_is_returned_for_a_started_frame():
    camera = prefetching()
    first, second, *_ = shaken()
    camera.update(first)
    camera.start(second)
    given = rigid(5, 4, 0.1)
    np.testing.assert_allclose(camera.update(second, motion=given).cur_from_prev, given)


def test_a_copy_is_independent_and_expects_the_started_frame():
    camera = prefetching()
    first, second, third, *_ = shaken()
    camera.update(first)
    camera.start(second)
    copied = deepcopy(camera)
    for frame in (second, third):
        found, expected = copied.update(frame), camera.update(frame)
        np.testing.assert_array_equal(found.cur_from_prev, expected.cur_from_prev)
        assert found.reliable


def test_another_frame_than_the_started_one_is_refused():
    first, second, *_ = shaken()
    camera = prefetching()
    camera.update(first)
    camera.start(second)
    with pytest.raises(ValueError, match="another frame was started as the next one"):
        camera.update(second.copy())


class SlowCamera(CameraMotion):
    """Is slow, and records whether two frames were processed at the same time."""

    def __init__(self):
        super().__init__()
        self.busy, self.overlapped = False, False

    def update(self, *arguments):
        self.overlapped |= self.busy
        self.busy = True
        time.sleep(0.1)
        self.busy = False
        return super().update(*arguments)


def test_after_a_refusal_frames_are_processed_one_by_one():
    first, second, third, *_ = shaken()
    slow = SlowCamera()
    camera = PrefetchingCameraMotion(slow)
    camera.update(first)
    camera.start(second)
    with pytest.raises(ValueError, match="another frame was started"):
        camera.update(third)
    camera.update(second)  # the started frame is still expected
    camera.update(third)
    assert not slow.overlapped


def test_a_refused_frame_does_not_change_the_state():
    """The started frame is already processed: another frame's motion would start there."""
    first, second, third, *_ = shaken()
    camera, alone = prefetching(), CameraMotion()
    for each in (camera, alone):
        each.update(first)
    camera.start(second)
    with pytest.raises(ValueError, match="another frame was started"):
        camera.update(third)
    with pytest.raises(ValueError, match="another frame was started"):
        camera.start(third)
    with pytest.raises(ValueError, match="motion is"):
        camera.update(second, motion=[[1, 2], [3]])
    for frame in (second, third):
        found, expected = camera.update(frame), alone.update(frame)
        np.testing.assert_array_equal(found.cur_from_prev, expected.cur_from_prev)


@pytest.mark.parametrize(
    ("frame", "exclude", "error"),
    [
        pytest.param(world(size_wh=(160, 120)), None, FrameSizeError, id="another size"),
        pytest.param(np.zeros((240, 320)), None, ValueError, id="not a frame"),
        pytest.param(world(size_wh=SIZE), (1, 2, 3), ValueError, id="not a box"),
    ],
)
def test_errors_of_the_worker_are_raised_by_update(frame, exclude, error):
    camera = prefetching()
    first, second, *_ = shaken()
    camera.update(first)
    camera.start(frame, exclude)
    with pytest.raises(error):
        camera.update(frame)
    assert camera.update(second).reliable  # and the camera is still usable


def test_work_on_the_started_frame_is_done_before_its_motion_is_returned():
    camera, done = prefetching(), []
    first, second, *_ = shaken()
    camera.update(first)
    camera.start(second, then=lambda frame: (time.sleep(0.05), done.append(frame)))
    camera.update(second)
    assert len(done) == 1
    assert done[0] is second
