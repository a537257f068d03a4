from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from helpers.locked_clip import COUNT, SIZE_WH, LockedClip, border, outside, widths
from ssiam.datasets import Shake
from ssiam.datasets.shake import camera_path
from ssiam.errors import ArgumentError
from ssiam.geometry import map_box, rigid
from ssiam.motion import Motion
from ssiam.render.locked import LockedViews, locked_views
from ssiam.render.locked_config import ASPECTS, POSITIONS, ZOOMS, LockedConfig
from ssiam.render.locked_live import LockedCamera


@pytest.mark.parametrize("aspect", ASPECTS)
def test_target_stays_in_the_middle_and_the_view_in_the_frame(aspect: str) -> None:
    clip = LockedClip()
    views = clip.views(aspect=aspect)
    distance = (clip.target_xy(views) - 0.5) * views.size_wh
    in_raw = np.hypot(*distance.T) * widths(views) / views.size_wh[0]
    assert np.sqrt(np.mean(in_raw**2)) < 3  # the target is 42 pixels large
    assert outside(views) < 0.5


@pytest.mark.parametrize("position", POSITIONS)
def test_target_stays_at_its_position(position: Any) -> None:
    clip = LockedClip()
    distance = (
        clip.target_xy(clip.views(position=position)) - LockedConfig(position=position).position_xy
    )
    assert np.abs(distance.mean(axis=0)).max() < 0.01
    assert distance.std(axis=0).max() < 0.03


def test_camera_is_smooth_although_the_boxes_are_noisy() -> None:
    clip = LockedClip()
    rng = np.random.default_rng(0)
    clip.boxes = [
        (x + rng.normal(), y + rng.normal(), w, h)
        for x, y, w, h in clip.truth  # type: ignore[misc]
    ]
    views = clip.views()
    third = np.diff(clip.camera_xy(views), 3, axis=0)
    assert np.sqrt(np.mean(third**2)) < 0.1  # that of the boxes is sqrt(20)
    distance = (clip.target_xy(views) - 0.5) * views.size_wh
    in_raw = np.hypot(*distance.T) * widths(views) / views.size_wh[0]
    assert np.sqrt(np.mean(in_raw**2)) < 1.15 * np.sqrt(2)


def test_horizon_is_level_under_roll() -> None:
    poses = camera_path(Shake(0.03), COUNT, SIZE_WH)
    shown = LockedClip().views().out_from_raw @ poses
    roll, left = (np.arctan2(each[:, 1, 0], each[:, 0, 0]) for each in (poses, shown))
    assert left.std() < 0.2 * roll.std()
    assert np.abs(np.diff(left)).max() < 0.01 * np.abs(np.diff(roll)).max()


def test_speed_and_acceleration_are_limited() -> None:
    clip = LockedClip()
    free = clip.camera_xy(clip.views())
    views = clip.views(max_speed=0.03, max_acceleration=0.1)
    camera = clip.camera_xy(views)
    speed, acceleration = (np.abs(np.diff(camera, order, axis=0)).max() for order in (1, 2))
    assert speed <= 1.05 * 0.03 * 640 / 30 < np.abs(np.diff(free, axis=0)).max()
    assert acceleration <= 1.3 * 0.1 * 640 / 900


def test_camera_stops_and_widens_while_the_target_is_lost() -> None:
    clip = LockedClip()
    clip.boxes[50:] = [None] * (COUNT - 50)
    views = clip.views()
    camera, width = clip.camera_xy(views), widths(views)
    assert (
        np.abs(np.diff(camera, axis=0))[60:].max() < 1.2
    )  # the target goes on at 1.2 pixels a frame
    assert width[-1] > 1.25 * width[:40].max()
    assert np.abs(np.diff(camera, axis=0)).max() < 3  # and it never jumps
    assert outside(views) < 2


def test_camera_moves_smoothly_to_a_target_that_is_found_again() -> None:
    clip = LockedClip()
    clip.boxes[50:110] = [None] * 60
    views = clip.views()
    assert np.abs(np.diff(clip.camera_xy(views), 2, axis=0)).max() < 1
    distance = clip.target_xy(views)[112:] - 0.5
    assert np.abs(distance).max() < 0.05


def test_without_a_target_the_view_is_wide_and_stable() -> None:
    clip = LockedClip(strength=0.02)
    clip.boxes = [None] * COUNT
    views = clip.views()
    assert np.abs(np.diff(clip.camera_xy(views), axis=0)).max() < 2
    assert widths(views).min() > 320
    assert outside(views) < 3


def test_zoom_follows_the_size_of_the_target_or_is_fixed() -> None:
    clip = LockedClip()
    clip.boxes = [
        map_box(np.diag([1, 1, 1]), (x, y, w * (1 + i / COUNT), h * (1 + i / COUNT)))
        for i, (x, y, w, h) in enumerate(clip.truth)  # type: ignore[misc]
    ]
    following, fixed = (
        widths(clip.views(zoom=zoom, target_share=0.7)) for zoom in ("follow", "fixed")
    )
    assert following[-20] > 1.4 * following[20]
    assert np.ptp(fixed) < 1e-6 * fixed[0]


def test_target_at_the_edge_narrows_the_view_and_then_leaves_the_middle() -> None:
    clip = LockedClip(strength=0.0)
    shifted = [(x - 170, y, w, h) for x, y, w, h in clip.truth]  # type: ignore[misc]
    clip.boxes = clip.truth = list(shifted)
    views = clip.views()
    assert widths(views)[0] < 0.8 * widths(views)[-1]
    assert outside(views) < 3


def test_a_shaken_target_near_the_edge_stays_near_the_middle() -> None:
    """Some border is better than 7 px of distance, for a target of 42."""
    clip = LockedClip()
    clip.boxes = [(x - 185, y, w, h) for x, y, w, h in clip.truth]  # type: ignore[misc]
    clip.truth = list(clip.boxes)
    views = clip.views()
    distance = (clip.target_xy(views) - 0.5) * views.size_wh
    in_raw = np.hypot(*distance.T) * widths(views) / views.size_wh[0]
    assert np.sqrt(np.mean(in_raw**2)) < 5
    assert border(views) < 0.01


@pytest.mark.parametrize("zoom", ZOOMS)
@pytest.mark.parametrize("position", ["middle", "right third"])
def test_hardly_any_border_is_shown_of_a_target_at_the_edge(zoom: Any, position: Any) -> None:
    clip = LockedClip(0.03, (150, 200))
    clip.boxes = [(x - 240, y - 90, w, h) for x, y, w, h in clip.truth]  # type: ignore[misc]
    assert border(clip.views(zoom=zoom, position=position)) < 0.01


def test_one_frame_and_two_frames() -> None:
    clip = LockedClip()
    for count in (1, 2, 5):
        views = locked_views(clip.motions[:count], clip.boxes[:count])
        assert views.out_from_raw.shape == (count, 3, 3)
        assert np.isfinite(views.out_from_raw).all()


@pytest.mark.parametrize("live", [False, True])
def test_zoom_is_not_faster_than_its_limit(live: bool) -> None:
    clip = LockedClip(0.0)
    clip.boxes = [
        box if i < 75 else (box[0] - 70, box[1] - 50, 170.0, 160.0)
        for i, box in enumerate(clip.truth)  # type: ignore[arg-type, index]
    ]
    for limit in (1.1, 1.3):
        config = LockedConfig(max_zoom_speed=limit, target_share=0.7)
        if live:
            camera = LockedCamera(SIZE_WH, config)
            pairs = zip(clip.motions, clip.boxes, strict=True)
            views = LockedViews(np.stack([camera.update(*each) for each in pairs]), SIZE_WH)
        else:
            views = locked_views(clip.motions, clip.boxes, config)
        fastest = np.abs(np.diff(np.log(widths(views)))).max()
        assert 0.9 * np.log(limit) / 30 < fastest < 1.01 * np.log(limit) / 30


def test_magnification_is_limited() -> None:
    clip = LockedClip(target_wh=(6, 6))
    assert widths(clip.views()).min() > 0.98 * 160
    assert widths(clip.views(max_zoom=2.0)).min() > 0.98 * 320


ODD_MOTIONS = {
    "scene cut": Motion.from_transform(rigid(300, -200, 1.0), SIZE_WH),
    "zoom": Motion.from_transform(np.diag([2.0, 2.0, 1.0]), SIZE_WH),
    "half turn": Motion.from_transform(rigid(0, 0, np.pi, (320, 180)), SIZE_WH),
    "tilt": Motion.from_transform([[1, 0, 0], [0, 1, 0], [1e-4, 1e-4, 1]], SIZE_WH),
}


@pytest.mark.parametrize("odd", ODD_MOTIONS)
@pytest.mark.parametrize("live", [False, True])
def test_odd_motions_and_boxes_give_views(odd: str, live: bool) -> None:
    clip = LockedClip()
    clip.motions[70] = ODD_MOTIONS[odd]
    clip.boxes[80] = -5000.0, 3000.0, 0.1, 900.0
    clip.boxes[90:92] = [(5.0, 5.0, 1300.0, 1.0)] * 2
    if live:
        camera = LockedCamera(SIZE_WH)
        views = np.stack(
            [camera.update(*each) for each in zip(clip.motions, clip.boxes, strict=True)]
        )
    else:
        views = clip.views().out_from_raw
    assert np.isfinite(views).all()
    zoom = np.sqrt(np.linalg.det(views[:, :2, :2]))
    assert zoom.min() > 0.4
    assert zoom.max() < 10


def test_size_of_the_output_is_even_and_fits_into_the_frame() -> None:
    sizes = {aspect: LockedConfig(aspect=aspect).size_wh((641, 361)) for aspect in ASPECTS}
    assert sizes == {
        "source": (640, 360),
        "16:9": (640, 360),
        "1:1": (360, 360),
        "9:16": (204, 360),
    }


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"aspect": "4:5"}, "aspect"),
        ({"zoom": "in"}, "zoom"),
        ({"position": "top"}, "position"),
        ({"target_share": 0.0}, "target_share is 0.0"),
        ({"target_share": 1.5}, "target_share is 1.5"),
        ({"max_zoom": 0.5}, "max_zoom is 0.5"),
        ({"max_zoom_speed": 1.0}, "max_zoom_speed is 1.0"),
        ({"tolerance": -1.0}, "tolerance is -1.0"),
        ({"max_speed": float("inf")}, "max_speed is inf"),
        ({"max_acceleration": float("nan")}, "max_acceleration is nan"),
    ],
)
def test_bad_settings_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        LockedConfig(**settings)


def test_bad_recordings_are_refused() -> None:
    clip = LockedClip()
    with pytest.raises(ArgumentError, match="0 motions and 0 boxes"):
        locked_views([], [])
    with pytest.raises(ArgumentError, match="150 motions and 3 boxes"):
        locked_views(clip.motions, clip.boxes[:3])
    with pytest.raises(ArgumentError, match=r"size_wh \(320, 240\)"):
        locked_views([*clip.motions[:-1], Motion.none((320, 240))], clip.boxes)
    for box in ((1.0, 2.0, 0.0, 3.0), (1.0, float("nan"), 2.0, 3.0)):
        with pytest.raises(ArgumentError, match="box is"):
            locked_views(clip.motions, [box, *clip.boxes[1:]])
    with pytest.raises(ArgumentError, match="rate is 0"):
        locked_views(clip.motions, clip.boxes, rate=0)
