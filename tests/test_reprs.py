"""Reprs fit into one line; frames are images in notebooks."""

from fractions import Fraction

import cv2
import numpy as np
import pytest

import ssiam
from ssiam.stabilize import StabilizerConfig
from ssiam.video import Frame, open_source

SHIFT = ssiam.Motion.from_transform([[1, 0, 3.25], [0, 1, -2]], (64, 48))
IMAGE = np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8)
SMALL_GATE = StabilizerConfig("paper").with_options(gate=0.5, keypoints="gftt")


def tracker(name="kcf", target=False):
    found = ssiam.load_tracker(name, stabilize="off")
    if target:
        found.init(IMAGE, (10, 10, 20, 20))
    return found


def group():
    found = ssiam.TrackerGroup(tracker())
    found.init(IMAGE, [(10, 10, 20, 20), (20, 20, 20, 20)])
    return found


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (SHIFT, "Motion(dx=3.2, dy=-2.0, angle=0.0000)"),
        (ssiam.Motion.none((64, 48)), "Motion(dx=0.0, dy=0.0, angle=0.0000, reliable=False)"),
        (ssiam.CameraMotion(), "CameraMotion('direct', model='similarity')"),
        (
            ssiam.CameraMotion("orb", model="rigid"),
            "CameraMotion('orb', fit='robust', model='rigid')",
        ),
        (StabilizerConfig(), "StabilizerConfig('predict')"),
        (
            SMALL_GATE,
            "StabilizerConfig('paper').with_options(keypoints='gftt', gate=0.5)",
        ),
        (ssiam.Stabilizer(StabilizerConfig("off")), "Stabilizer(StabilizerConfig('off'))"),
        (tracker(), "StabilizedTracker(OpenCvTracker, StabilizerConfig('off'))"),
        (
            tracker(target=True),
            "StabilizedTracker(OpenCvTracker, StabilizerConfig('off'), has_target=True)",
        ),
        (
            group(),
            "TrackerGroup(StabilizedTracker(OpenCvTracker, StabilizerConfig('off')), targets=2)",
        ),
        (ssiam.FrameView(IMAGE, border=20), "FrameView(64x48, border=20, is_raw=True)"),
        (Frame(3, 0.12, IMAGE), "Frame(3, 0.120 s, 64x48)"),
        (Frame(3, None, IMAGE), "Frame(3, 64x48)"),
    ],
)
def test_a_repr_is_one_short_line(value, text):
    assert repr(value) == text


def test_the_repr_of_a_config_gives_the_config():
    assert eval(repr(SMALL_GATE)) == SMALL_GATE


def test_the_repr_of_a_source(request):
    with open_source(request.config.rootpath / "examples" / "shaky-walker.mp4") as source:
        assert repr(source).endswith("shaky-walker.mp4', 640x360, 25.00 fps, 117 frames)")
        assert source.fps == Fraction(25)


def shown(value):
    return cv2.imdecode(np.frombuffer(value._repr_png_(), np.uint8), cv2.IMREAD_COLOR)


def test_notebooks_show_frames_tracks_and_stabilized_views():
    frame = Frame(0, None, IMAGE)
    np.testing.assert_array_equal(shown(frame), IMAGE)
    drawn = frame.drawn(ssiam.Track((10, 10, 20, 20)))
    np.testing.assert_array_equal(shown(drawn), drawn.image)
    assert (drawn.image != IMAGE).any()
    np.testing.assert_array_equal(frame.image, IMAGE)
    view = ssiam.FrameView(IMAGE, SHIFT.cur_from_prev, border=5)
    np.testing.assert_array_equal(shown(view), view.render())
