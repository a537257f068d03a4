"""`Crop`: shares, words and the crop that a correction needs."""

import numpy as np
import pytest

from ssiam.errors import ArgumentError
from ssiam.geometry import frame_center, rigid
from ssiam.render import CameraView, Crop
from ssiam.render.crop import cropped, needed_crop

SIZE = (640, 360)


@pytest.mark.parametrize(
    ("text", "share"), [("auto", None), ("none", 0.0), ("10", 0.1), ("7.5%", 0.075), ("0", 0.0)]
)
def test_words_and_percentages(text, share):
    assert Crop.parse(text).share == pytest.approx(share)


@pytest.mark.parametrize("text", ["", "some", "-1", "81", "nan", "10 px"])
def test_refused_words(text):
    with pytest.raises(ArgumentError, match="--crop"):
        Crop.parse(text)


@pytest.mark.parametrize("share", [-0.1, 0.9, float("nan")])
def test_refused_shares(share):
    with pytest.raises(ArgumentError, match="crop is"):
        Crop(share)


@pytest.mark.parametrize(
    ("view_from_raw", "needed"),
    [
        (np.eye(3), 0.0),
        (rigid(32, 0, 0), 0.1),
        (rigid(0, -18, 0), 0.1),
        (rigid(32, 36, 0), 0.2),
        (rigid(1000, 0, 0), 1.0),
    ],
)
def test_shift_needs_twice_its_share(view_from_raw, needed):
    assert float(needed_crop(view_from_raw, SIZE)) == pytest.approx(needed)


@pytest.mark.parametrize("view", [rigid(20, 7, 0.05, frame_center(SIZE)), rigid(-3, 9, -0.2)])
def test_needed_crop_is_the_smallest_that_hides_the_border(view):
    needed = float(needed_crop(view, SIZE))
    for more, is_filled in ((0.0, True), (-0.01, False)):
        out_from_raw = cropped(view, needed + more, SIZE)
        assert CameraView(out_from_raw, SIZE).is_filled_by(SIZE) == is_filled


def test_automatic_share_covers_nearly_all_frames():
    needed = np.concatenate([np.full(298, 0.04), [0.12, 0.5]])
    assert Crop().chosen(needed) == pytest.approx(0.04)
    assert Crop().chosen(np.full(10, 0.6)) == pytest.approx(0.15)
    assert Crop(0.02).chosen(needed) == 0.02
