"""A mask of what moves with the camera."""

import numpy as np
import pytest

import ssiam
from helpers.own_vehicle import HOOD, frames
from ssiam import CameraMotion
from ssiam.errors import ArgumentError

BOX = (280.0, 60.0, 40.0, 40.0)


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


@pytest.mark.parametrize("keypoints", ["gftt", "harris"])
def test_keypoints_in_the_mask_are_not_used(keypoints):
    clip = frames()
    assert shift(CameraMotion(keypoints), clip) != pytest.approx(9, abs=1)
    assert shift(CameraMotion(keypoints, mask=HOOD), clip) == pytest.approx(9, abs=0.3)


def test_a_function_makes_the_mask_of_the_frames_size():
    sizes = []

    def mask_of(size_wh):
        sizes.append(size_wh)
        return HOOD

    assert shift(CameraMotion(mask=mask_of), frames()) == pytest.approx(9, abs=0.3)
    assert sizes == [(640, 360)]
    assert shift(CameraMotion(mask=lambda _: None), frames()) != pytest.approx(9, abs=1)


def test_what_a_function_makes_is_checked():
    with pytest.raises(ArgumentError, match="the mask has 320x180 pixels"):
        CameraMotion(mask=lambda _: HOOD[::2, ::2]).update(frames()[0])
    with pytest.raises(ArgumentError, match="mask is 'hood'"):
        CameraMotion(mask=lambda _: "hood").update(frames()[0])


def test_a_tracker_and_its_clones_leave_the_mask_out():
    clip = frames()
    tracker = ssiam.load_tracker("kcf", static_mask=HOOD)
    group = ssiam.TrackerGroup(tracker)
    for each in (tracker, tracker.clone()):
        each.init(clip[0], BOX)
        assert each.update(clip[1]).motion.shift_angle[0] == pytest.approx(9, abs=0.3)
        each.switch(ssiam.StabilizerConfig("paper", keypoints="gftt"), clip[1])
        assert each.update(clip[2]).motion.shift_angle[0] == pytest.approx(-9, abs=0.3)
    group.init(clip[0], [BOX])
    group.update(clip[1])
    assert group.motion.shift_angle[0] == pytest.approx(9, abs=0.3)


def test_a_tracker_refuses_what_is_no_mask():
    with pytest.raises(ArgumentError, match="mask is 'hood'"):
        ssiam.load_tracker("kcf", static_mask="hood")
