"""Sources of more than 8 bits per value: one pair of levels for the whole source."""

from __future__ import annotations

from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from helpers.video_clips import number_in, numbered_image, python
from ssiam.errors import ArgumentError, SourceError
from ssiam.video import RawFormat, open_source
from ssiam.video.levels import LEVEL_FRAMES, Levels, find_levels

LOW, SCALE = 7000, 6


def _gray(number):
    return cv2.cvtColor(numbered_image(number), cv2.COLOR_BGR2GRAY)


def _thermal(number):
    """14 bits in 16, as from thermal cameras: the scene fills a fortieth of the range."""
    return (LOW + _gray(number).astype(np.uint16) * SCALE).astype(np.uint16)


def _folder(tmp_path, suffix, image_of, count=12):
    folder = tmp_path / "seq"
    folder.mkdir()
    for number in range(count):
        cv2.imwrite(str(folder / f"{number}{suffix}"), image_of(number))
    return folder


def _video(tmp_path, pixel_format, image_of, count=12):
    path = tmp_path / "thermal.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 96, pixel_format
        for number in range(count):
            frame = av.VideoFrame.from_ndarray(image_of(number), format=pixel_format)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def _sources(tmp_path):
    return {
        "png": lambda: _folder(tmp_path, ".png", _thermal),
        "tiff": lambda: _folder(tmp_path, ".tiff", _thermal),
        "float tiff": lambda: _folder(
            tmp_path, ".tif", lambda number: (_thermal(number) / 100 - 273.15).astype(np.float32)
        ),
        "gray16": lambda: _video(tmp_path, "gray16le", _thermal),
        "gray12": lambda: _video(tmp_path, "gray12le", lambda number: _thermal(number) - 6000),
        "color": lambda: _folder(
            tmp_path,
            ".png",
            lambda n: (200 + numbered_image(n).astype(np.uint16) * 4).astype(np.uint16),
        ),
    }


@pytest.mark.parametrize("kind", ["png", "tiff", "float tiff", "gray16", "gray12", "color"])
def test_contrast_is_kept(tmp_path, kind):
    with open_source(_sources(tmp_path)[kind]()) as source:
        frames = list(source)
    assert [number_in(frame.image) for frame in frames] == list(range(12))
    stretched = frames[3].image.astype(float)
    true = numbered_image(3) if kind == "color" else cv2.cvtColor(_gray(3), cv2.COLOR_GRAY2BGR)
    assert len(np.unique(frames[3].image)) > 0.8 * len(np.unique(true))
    assert np.corrcoef(stretched.ravel(), true.ravel())[0, 1] > 0.999
    assert "--levels" in source.info.notes[0]


def test_levels_are_constant_over_the_source(tmp_path):
    """A hot object that comes into view must not darken the rest."""

    def image_of(number):
        image = _thermal(0)
        if number >= 10:
            image[60:, 100:] = 20000
        return image

    with open_source(_folder(tmp_path, ".png", image_of)) as source:
        frames = [frame.image for frame in source]
    assert np.array_equal(frames[0][:60, :100], frames[11][:60, :100])
    assert (frames[11][60:, 100:] == 255).all()


def test_explicit_levels(tmp_path):
    folder = _folder(tmp_path, ".png", _thermal)
    with open_source(folder, levels=(LOW, LOW + 255 * SCALE)) as source:
        frame = next(source)
        assert source.info.notes == []
    assert np.abs(frame.image[..., 0].astype(int) - _gray(0)).max() <= 1


def test_first_frames_without_content(tmp_path):
    """A thermal camera starts with a closed shutter."""

    def image_of(number):
        flat = np.full((96, 160), 3000, np.uint16) + (np.arange(160) % 3).astype(np.uint16)
        return _thermal(number) if number > LEVEL_FRAMES + 1 else flat

    folder = _folder(tmp_path, ".png", image_of, LEVEL_FRAMES + 6)
    with open_source(folder) as source:
        frames = [frame.image for frame in source]
    assert len(frames) == LEVEL_FRAMES + 6
    assert (frames[0] == 128).all()
    assert [number_in(image) for image in frames[LEVEL_FRAMES + 2 :]] == [10, 11, 12, 13]


def test_buffered_frames_are_delivered_before_an_error(tmp_path):
    folder = _folder(tmp_path, ".png", _thermal, 4)
    (folder / "3.png").write_bytes(b"not an image")
    delivered = []
    with open_source(folder) as source, pytest.raises(Exception, match="after 3 of 4 frames"):
        delivered.extend(number_in(frame.image) for frame in source)
    assert delivered == [0, 1, 2]


def test_raw_gray16_from_a_file(tmp_path):
    path = tmp_path / "frames.raw"
    path.write_bytes(b"".join(_thermal(number).tobytes() for number in range(3)))
    with open_source(path, raw=RawFormat((160, 96), "gray16le", Fraction(9))) as source:
        frames = list(source)
    assert [number_in(frame.image) for frame in frames] == [0, 1, 2]
    assert [frame.time for frame in frames] == pytest.approx([0, 1 / 9, 2 / 9])


def test_8bit_sources_are_not_scaled(tmp_path):
    folder = _folder(tmp_path, ".png", numbered_image, 3)
    with open_source(folder) as source:
        assert all(np.array_equal(f.image, numbered_image(f.index)) for f in source)
        assert source.info.notes == []
    with pytest.raises(SourceError, match=r"has 8 bits per value already; omit the levels 1,9"):
        open_source(folder, levels=(1, 9))
    with pytest.raises(SourceError, match="omit the levels"):
        open_source(99, levels=(1, 9))


@pytest.mark.parametrize("levels", [(5, 5), (9, 1), (float("nan"), 1), (0, float("inf"))])
def test_invalid_levels_are_refused(levels):
    with pytest.raises(ArgumentError, match="the darker one first"):
        open_source("missing.mp4", levels=levels)
    with pytest.raises(ArgumentError):
        Levels(*levels)


def test_find_levels():
    assert find_levels([]) is None
    assert find_levels([np.full((9, 9), np.nan, np.float32)]) is None
    assert find_levels([numbered_image(1)]) is None
    hot = np.full((100, 100), 300.0, np.float32)
    hot[0, 0], hot[:50] = np.inf, 290.0
    levels = find_levels([hot])
    assert (levels.low, levels.high) == pytest.approx((289.5, 300.5))


_PEAK = """
import resource, sys
from ssiam.video import open_source
with open_source(sys.argv[1]) as source:
    print(sum(1 for _ in source), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
"""


def test_memory_use_of_a_long_stack(tmp_path):
    """200 pages of 0.6 MB."""
    page = np.random.default_rng(0).integers(0, 60000, (480, 640)).astype(np.uint16)
    peaks = []
    for count in (40, 240):
        path = tmp_path / f"{count}.tif"
        cv2.imwritemulti(str(path), [page] * count, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
        frames, peak = python(_PEAK, str(path), stdout=-1).communicate()[0].split()
        assert int(frames) == count
        peaks.append(int(peak))
    # The file itself is in memory: 200 more pages are 123 MB.
    assert peaks[1] - peaks[0] < 180
