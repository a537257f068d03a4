from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from helpers.locked_clip import COUNT, SIZE_WH, LockedClip, outside, widths
from ssiam.errors import ArgumentError
from ssiam.motion import Motion
from ssiam.render.locked import LockedViews
from ssiam.render.locked_config import ASPECTS, POSITIONS, LockedConfig
from ssiam.render.locked_live import LockedCamera


def live(clip: LockedClip, **settings: Any) -> LockedViews:
    """The views of the live camera."""
    camera = LockedCamera(SIZE_WH, LockedConfig(**settings))
    views = [camera.update(*each) for each in zip(clip.motions, clip.boxes, strict=True)]
    return LockedViews(np.stack(views), camera.out_size_wh)


@pytest.mark.parametrize("aspect", ASPECTS)
@pytest.mark.parametrize("strength", [0.0, 0.03])
def test_target_stays_in_the_middle_and_the_view_in_the_frame(aspect: str, strength: float) -> None:
    clip = LockedClip(strength)
    views = live(clip, aspect=aspect)
    distance = (clip.target_xy(views) - 0.5) * views.size_wh
    in_raw = np.hypot(*distance.T) * widths(views) / views.size_wh[0]
    assert np.sqrt(np.mean(in_raw[30:] ** 2)) < 6  # the target is 42 pixels large
    assert outside(views) < 1e-6


@pytest.mark.parametrize("position", POSITIONS)
def test_target_stays_at_its_position(position: Any) -> None:
    clip = LockedClip(0.01)
    distance = (
        clip.target_xy(live(clip, position=position)) - LockedConfig(position=position).position_xy
    )
    assert np.abs(distance[30:].mean(axis=0)).max() < 0.02


def test_camera_is_smoother_than_the_boxes() -> None:
    clip = LockedClip(0.01)
    rng = np.random.default_rng(0)
    clip.boxes = [
        (x + rng.normal(), y + rng.normal(), w, h)
        for x, y, w, h in clip.truth  # type: ignore[misc]
    ]
    third = np.diff(clip.camera_xy(live(clip)), 3, axis=0)[30:]
    assert np.sqrt(np.mean(third**2)) < np.sqrt(20) / 3


def test_what_comes_changes_nothing_before() -> None:
    clip = LockedClip()
    whole = live(clip).out_from_raw
    clip.boxes[100:] = [None] * (COUNT - 100)
    np.testing.assert_array_equal(live(clip).out_from_raw[:100], whole[:100])


def test_camera_stops_and_widens_while_the_target_is_lost() -> None:
    clip = LockedClip(0.01)
    clip.boxes[50:] = [None] * (COUNT - 50)
    views = live(clip, target_share=0.6)
    steps = np.abs(np.diff(clip.camera_xy(views), axis=0))
    assert np.quantile(steps[80:], 0.95) < 0.5
    assert steps[49:].max() < 5  # where the edge of the frame moves the view
    assert widths(views)[-1] > 1.5 * widths(views)[49]
    assert outside(views) < 1e-6


def test_camera_does_not_jump_to_a_target_that_is_found_again() -> None:
    clip = LockedClip(0.01)
    clip.boxes[50:110] = [None] * 60
    views = live(clip, target_share=0.6)
    assert np.abs(np.diff(clip.camera_xy(views), 2, axis=0))[50:].max() < 5
    assert np.abs(clip.target_xy(views)[140:] - 0.5).max() < 0.1


def test_speed_and_acceleration_are_limited() -> None:
    clip = LockedClip(0.0)
    camera = clip.camera_xy(live(clip, max_speed=0.03, max_acceleration=0.1))
    assert np.abs(np.diff(camera, axis=0)).max() <= 0.03 * 640 / 30 + 1e-6
    assert np.abs(np.diff(camera, 2, axis=0)).max() <= 0.1 * 640 / 900 + 1e-6


def test_fixed_zoom_does_not_change() -> None:
    clip = LockedClip()
    clip.boxes[50:80] = [None] * 30
    assert np.ptp(widths(live(clip, zoom="fixed"))) < 1e-6


def test_target_that_appears_later() -> None:
    clip = LockedClip(0.01)
    clip.boxes[:50] = [None] * 50
    for zoom in ("follow", "fixed"):
        views = live(clip, target_share=0.6, zoom=zoom)
        assert widths(views)[49] > 1.3 * widths(views)[-1]
        assert np.abs(clip.target_xy(views)[90:] - 0.5).max() < 0.1


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_a_copy_is_independent(copied: Any) -> None:
    clip = LockedClip()
    camera = LockedCamera(SIZE_WH)
    for motion, box in zip(clip.motions[:20], clip.boxes[:20], strict=True):
        camera.update(motion, box)
    other = copied(camera)
    other.update(clip.motions[50], None)
    other = copied(camera)
    np.testing.assert_array_equal(
        camera.update(clip.motions[20], clip.boxes[20]),
        other.update(clip.motions[20], clip.boxes[20]),
    )


def test_motion_of_another_size_is_refused_and_changes_nothing() -> None:
    clip = LockedClip()
    camera = LockedCamera(SIZE_WH)
    with pytest.raises(ArgumentError, match=r"size_wh \(320, 240\)"):
        camera.update(Motion.none((320, 240)), None)
    np.testing.assert_array_equal(
        camera.update(clip.motions[0], clip.boxes[0]), live(clip).out_from_raw[0]
    )


def test_box_that_is_empty_is_refused() -> None:
    clip = LockedClip()
    with pytest.raises(ArgumentError, match="box is"):
        LockedCamera(SIZE_WH).update(clip.motions[0], (1.0, 2.0, -3.0, 4.0))


def test_bad_rate_is_refused() -> None:
    with pytest.raises(ArgumentError, match="rate is nan"):
        LockedCamera(SIZE_WH, rate=float("nan"))
