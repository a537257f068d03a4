"""MIL repeats its results, and does not affect other random numbers of the process."""

import ctypes
import sys

import cv2
import numpy as np
import pytest

import ssiam
from helpers.synthetic import world
from ssiam.video import open_source

BOX = (53.2, 114.1, 26.5, 66.4)


def test_results_repeat(request):
    with open_source(request.config.rootpath / "examples" / "shaky-walker.mp4") as source:
        frames = [frame.image for frame, _ in zip(source, range(16), strict=False)]
    runs = []
    for _ in range(2):
        tracker = ssiam.load_tracker("mil")
        tracker.init(frames[0], BOX)
        runs.append([tracker.update(frame).box for frame in frames[1:]])
        cv2.setRNGSeed(7)  # a seed in this thread has no effect
    assert runs[0] == runs[1]


def drawn():
    image = np.zeros((1, 8), np.uint8)
    return cv2.randu(image, 0, 255).tolist()


def test_opencvs_random_numbers_are_not_affected():
    cv2.setRNGSeed(3)
    expected = [drawn(), drawn()]
    cv2.setRNGSeed(3)
    first = drawn()
    ssiam.load_tracker("mil", stabilize="off").init(world(), (300, 150, 40, 50))
    assert [first, drawn()] == expected


@pytest.mark.skipif(sys.platform != "linux", reason="only glibc's generator is restored")
def test_the_c_librarys_random_numbers_are_not_affected():
    library = ctypes.CDLL(None)
    if not hasattr(library, "gnu_get_libc_version"):
        pytest.skip("not glibc")
    library.srand(5)
    expected = [library.rand() for _ in range(6)]
    library.srand(5)
    found = [library.rand() for _ in range(3)]
    ssiam.load_tracker("mil", stabilize="off").init(world(), (300, 150, 40, 50))
    assert found + [library.rand() for _ in range(3)] == expected


@pytest.mark.parametrize("size_wh", [(1, 1), (4, 4), (2, 10), (100, 1)])
def test_a_box_too_small_for_any_feature_is_refused(size_wh):
    w, h = size_wh
    with pytest.raises(ssiam.ArgumentError, match=f"mil cannot track a box of {w}x{h} pixels"):
        ssiam.load_tracker("mil", stabilize="off").init(world(), (300, 150, w, h))


@pytest.mark.parametrize(
    ("name", "box"),
    [("csrt", (5, 5, 600, 4)), ("csrt", (300, 5, 4, 340)), ("mil", (0, 0, 640, 360))],
)
def test_boxes_that_opencv_refuses_raise_one_line(name, box):
    tracker = ssiam.load_tracker(name, stabilize="off")
    tracker.init(world(), (300, 150, 40, 50))
    before = tracker.update(world())
    with pytest.raises(ssiam.ArgumentError, match=rf"^{name} cannot track a box of .*$"):
        tracker.init(world(), box)
    assert tracker.update(world()).box == pytest.approx(before.box, abs=2)
