"""Several OpenCV distributions in one environment: one warning, which can be silenced."""

import os
import subprocess
import sys

import cv2
import numpy as np
import pytest

import ssiam
from ssiam.errors import MissingExtraError
from ssiam.motion import CameraMotion

HEADLESS = "opencv_contrib_python_headless"


def imported(folder, *names, options=()):
    """What importing ssiam prints where these distributions are installed too."""
    for name in names:
        info = folder / f"{name}-5.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 5.0\n")
    paths = os.pathsep.join([str(folder), *sys.path])
    done = subprocess.run(
        [sys.executable, *options, "-c", "import ssiam, ssiam.video; import ssiam"],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": paths},
    )
    assert done.returncode == 0
    return done.stderr


def test_several_are_named_in_one_line(tmp_path):
    (line,) = imported(tmp_path, "opencv_python", HEADLESS).splitlines()
    assert "(opencv-python, opencv-contrib-python-headless)" in line
    assert "cv2.imshow" in line


def test_one_is_not_worth_a_line(tmp_path):
    assert imported(tmp_path, HEADLESS) == ""


@pytest.mark.parametrize("options", [["-W", "ignore"], ["-W", "ignore:several"]])
def test_the_warning_can_be_silenced(tmp_path, options):
    assert imported(tmp_path, "opencv_python", HEADLESS, options=options) == ""


@pytest.mark.parametrize("name", ["csrt", "kcf"])
def test_an_opencv_without_the_contributed_trackers_is_named(monkeypatch, name):
    monkeypatch.delattr(cv2, f"Tracker{name.upper()}")
    tracker = ssiam.load_tracker(name)
    image = np.random.default_rng(0).integers(0, 256, (120, 160, 3), np.uint8)
    with pytest.raises(ssiam.MissingExtraError, match=rf"has no {name}: .*force-reinstall"):
        tracker.init(image, (40, 30, 40, 40))


def test_without_the_contributed_modules_only_what_needs_them_is_refused(monkeypatch):
    for name in ("TrackerCSRT", "TrackerKCF", "BRISK", "xfeatures2d"):
        monkeypatch.delattr(cv2, name, raising=False)
    frame = np.zeros((60, 80, 3), np.uint8)
    for name in ("csrt", "kcf"):
        with pytest.raises(MissingExtraError, match=f"has no {name}: another OpenCV package"):
            ssiam.load_tracker(name).init(frame, (10, 10, 30, 30))
    with pytest.raises(MissingExtraError, match="has no BRISK: pip install"):
        CameraMotion(keypoints="brisk").update(frame)
    for name in ("lite", "mil"):
        tracker = ssiam.load_tracker(name)
        tracker.init(frame, (10, 10, 30, 30))
        assert tracker.update(frame).box
