"""Histograms of the colors in a box."""

import cv2
import numpy as np
import pytest

from ssiam.stabilize import FrameView
from ssiam.trackers.colors import color_histogram, color_similarity

BOX = (10.0, 10.0, 40.0, 40.0)


def histogram(image):
    return color_histogram(FrameView(image, np.eye(3), 0), BOX)


def reference(image):
    """The histogram by OpenCV's conversion of colors."""
    crop = FrameView(image, np.eye(3), 0).crop((13.2, 13.2, 33.6, 33.6), (40, 40)).image
    lab = np.clip(cv2.cvtColor(crop, cv2.COLOR_BGR2LAB), 78, 177)
    counts = cv2.calcHist([lab], [1, 2], None, [14, 14], [78, 178, 78, 178])
    smooth = cv2.GaussianBlur(counts, (0, 0), 1.0).ravel().astype(float)
    return np.sqrt(smooth / smooth.sum())


@pytest.mark.parametrize(
    "bgr", [(0, 0, 0), (255, 255, 255), (60, 60, 140), (140, 60, 60), (3, 9, 6), (0, 200, 250)]
)
def test_a_color_is_where_opencv_has_it(bgr):
    image = np.full((60, 60, 3), bgr, np.uint8)
    assert color_similarity(histogram(image), reference(image)) > 0.99


def test_many_colors_are_where_opencv_has_them():
    image = np.random.default_rng(0).integers(0, 256, (60, 60, 3), np.uint8)
    assert color_similarity(histogram(image), reference(image)) > 0.999


def test_brightness_does_not_count_and_color_does():
    dark, bright, other = (
        np.full((60, 60, 3), bgr, np.uint8) for bgr in ((40, 40, 40), (220, 220, 220), (40, 40, 90))
    )
    assert color_similarity(histogram(dark), histogram(bright)) == pytest.approx(1)
    assert color_similarity(histogram(dark), histogram(other)) < 0.5
