"""Frames of shaken clips: motion, cropping, blur and rolling shutter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers.datasets_on_disk import boxes, write_otb
from helpers.shake_clips import BLOB, SIZE, STRENGTH, blob_clip, sequence
from ssiam.datasets import SHAKE_KINDS, Shake, open_dataset, shaken
from ssiam.errors import FrameSizeError
from ssiam.geometry import map_points


@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_a_strength_of_0_returns_the_raw_frames(tmp_path, kind):
    folder = write_otb(tmp_path, "Walking", range(1, 5), boxes(4))
    raw = open_dataset(folder).sequences["Walking"]
    same = shaken(raw, Shake(0, kind, exposure=0.5, readout=0.5, border="crop"))
    assert np.array_equal(same.truth, raw.truth)
    assert np.array_equal(same.shaken_from_raw, [np.eye(3)] * 4)
    for start in (0, 2):
        images = list(same.images(start))
        assert len(images) == 4 - start
        assert all(map(np.array_equal, images, raw.images(start)))


def test_frames_do_not_depend_on_the_start(tmp_path):
    clip = shaken(blob_clip(tmp_path, count=5), Shake(STRENGTH, "gusts"))
    assert all(map(np.array_equal, list(clip.images())[3:], clip.images(3)))


def gradient():
    """An image whose blue is x and whose green is y."""
    y, x = np.mgrid[:180, :250]
    return np.stack([x, y, np.zeros_like(x)], axis=2).astype(np.uint8)


@pytest.mark.parametrize("readout", [0.0, 0.7], ids=["global shutter", "rolling shutter"])
@pytest.mark.parametrize("kind", SHAKE_KINDS)
def test_cropping_never_leaves_the_raw_frame(tmp_path, kind, readout):
    raw = sequence(tmp_path, gradient(), 40, [[100, 80, 30, 20]] * 40)
    shake = Shake(0.04, kind, border="crop", readout=readout)
    clip = shaken(raw, shake)
    width, height = clip.size_wh
    for index, image in enumerate(clip.images()):
        rows = clip.camera._delays(np.arange(height, dtype=float))
        for row in (0, height // 2, height - 1):
            raw_from_shaken = np.linalg.inv(clip.camera.path.at(index + rows[row]))
            positions = map_points(raw_from_shaken, [(x, row) for x in range(width)])
            assert positions.min() > -1e-6
            assert (positions.max(axis=0) < (249 + 1e-6, 179 + 1e-6)).all()
            assert abs(image[row, :, :2] - positions).max() < 0.6


def test_the_cropped_size_does_not_depend_on_the_seed(tmp_path):
    raw = blob_clip(tmp_path)
    sizes = {shaken(raw, Shake(0.01, seed=n, border="crop")).size_wh for n in range(5)}
    assert len(sizes) == 1
    width, height = sizes.pop()
    assert (width, height) > (0.9 * SIZE[0], 0.85 * SIZE[1])


def covariance(image):
    """Covariance (2, 2) of the intensity in x and y, pixels squared."""
    intensity = image[..., 0].astype(np.float64)
    y, x = np.mgrid[: intensity.shape[0], : intensity.shape[1]]
    return np.cov(x.ravel(), y.ravel(), aweights=intensity.ravel())


def test_motion_blur_follows_the_path(tmp_path):
    clip = shaken(blob_clip(tmp_path), Shake(0.05, exposure=0.8))
    for index, image in enumerate(clip.images()):
        times = index + np.linspace(-0.4, 0.4, 200)
        track = np.array([map_points(pose, [BLOB])[0] for pose in clip.camera.path.at(times)])
        expected = 3.0**2 * np.eye(2) + np.cov(track.T)
        assert covariance(image) == pytest.approx(expected, rel=0.06, abs=1.5)


def test_a_rolling_shutter_shears_vertical_lines(tmp_path):
    frame = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    frame[:, 158:163] = 255
    raw = sequence(tmp_path, frame, 20, [[150, 100, 20, 20]] * 20)
    for readout in (0.0, 0.5):
        clip = shaken(raw, Shake(STRENGTH, "handheld", readout=readout))
        columns = np.arange(SIZE[0])
        for index, image in enumerate(clip.images()):
            line = image[20:220, :, 0].astype(float)
            found = (line * columns).sum(axis=1) / line.sum(axis=1)
            ends = np.polyfit(np.arange(20, 220), found, 1)[0] * SIZE[1]
            start, end = clip.camera.path.at(index + np.array([-readout / 2, readout / 2]))
            angle = (start[0, 1] + end[0, 1]) / 2
            shift = map_points(end, [(160, 120)])[0, 0] - map_points(start, [(160, 120)])[0, 0]
            assert ends == pytest.approx(shift + angle * SIZE[1], abs=1.0)


def test_frames_of_another_size_are_an_error(tmp_path):
    raw = replace(blob_clip(tmp_path, count=2), size_wh=(300, 240))
    with pytest.raises(FrameSizeError, match="clip: frame 0 is 320x240, not 300x240"):
        list(shaken(raw, Shake(STRENGTH)).images())
