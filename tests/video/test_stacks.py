"""Image files with several frames, and frames that cannot be decoded."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from helpers.odd_clips import write_undecodable
from helpers.video_clips import number_in, numbered_image, read_all, write_clip
from ssiam.errors import SourceError, StreamError
from ssiam.video import open_source
from ssiam.video.images import read_pages


def _tiff(path, numbers, extra=()):
    pages = [*map(numbered_image, numbers), *extra]
    assert cv2.imwritemulti(str(path), pages)
    return path


@pytest.mark.parametrize("count", [1, 5, 40])
def test_tiff_pages_are_frames(tmp_path, count):
    path = _tiff(tmp_path / "stack.tif", range(count))
    with open_source(path) as source:
        assert source.length == count
        frames = list(source)
    assert [number_in(frame.image) for frame in frames] == list(range(count))
    assert [frame.time for frame in frames] == pytest.approx([i / 30 for i in range(count)])
    assert np.array_equal(frames[-1].image, numbered_image(count - 1))


def test_stacks_in_a_folder_yield_all_frames(tmp_path):
    folder = tmp_path / "seq"
    folder.mkdir()
    cv2.imwrite(str(folder / "1.png"), numbered_image(0))
    _tiff(folder / "2.tif", range(1, 4))
    _webp(folder / "3.webp", range(4, 7), 40)
    cv2.imwrite(str(folder / "10.webp"), numbered_image(7), [cv2.IMWRITE_WEBP_QUALITY, 95])
    with open_source(folder) as source:
        assert source.length == 8
        assert [number_in(frame.image) for frame in source] == list(range(8))


def test_smaller_pages_are_skipped(tmp_path):
    path = _tiff(tmp_path / "photo.tif", [7], extra=[numbered_image(9, 80, 48)])
    with open_source(path) as source:
        assert [number_in(frame.image) for frame in source] == [7]


def test_truncated_tiff_delivers_frames_then_raises(tmp_path):
    path = _tiff(tmp_path / "stack.tif", range(8))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with open_source(path) as source:
        numbers, error = read_all(source)
    assert 0 < len(numbers) < 8
    assert numbers == list(range(len(numbers)))
    assert isinstance(error, StreamError)
    assert "broke off" in str(error)


def _webp(path, numbers, milliseconds):
    animation = cv2.Animation()
    animation.frames = [numbered_image(number) for number in numbers]
    animation.durations = np.full(len(numbers), milliseconds, np.int32)
    assert cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 95])
    return path


@pytest.mark.parametrize("count", [2, 40])
def test_animated_webp(tmp_path, count):
    path = _webp(tmp_path / "clip.webp", range(count), 50)
    with open_source(path) as source:
        assert source.length == count
        assert source.fps == 20
        frames = list(source)
    assert [number_in(frame.image) for frame in frames] == list(range(count))
    assert [frame.time for frame in frames] == pytest.approx([i / 20 for i in range(count)])


def test_truncated_animated_webp(tmp_path):
    path = _webp(tmp_path / "clip.webp", range(12), 50)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    try:
        with open_source(path) as source:
            error = read_all(source)[1]
    except SourceError as refused:
        error = refused
    assert isinstance(error, StreamError | SourceError)


@pytest.mark.parametrize("codec", ["mjpeg", "libx264"])
def test_undecoded_frames_are_counted(tmp_path, codec):
    path = write_undecodable(tmp_path / "clip.mov", (10, 11, 25), codec)
    with open_source(path) as source:
        numbers = [number_in(frame.image) for frame in source]
    assert len(numbers) + source.info.undecoded == 40
    assert source.info.undecoded == 3
    assert set(range(40)) - set(numbers) == {10, 11, 25}


def test_intact_file_has_no_undecoded_frames(tmp_path):
    with open_source(write_clip(tmp_path / "clip.mp4", 40)) as source:
        assert len(list(source)) == 40
    assert source.info.undecoded == 0


def test_file_truncated_while_decoding_does_not_crash(tmp_path, monkeypatch):
    """Another program truncates the file while it is decoded: a memory map would crash (SIGBUS)."""
    path = tmp_path / "frame.png"
    cv2.imwrite(str(path), np.random.default_rng(0).integers(0, 255, (400, 600, 3), np.uint8))
    decode = cv2.imdecode

    def truncate_first(data, flags):
        path.write_bytes(b"")
        return decode(data, flags)

    monkeypatch.setattr(cv2, "imdecode", truncate_first)
    ((duration, image),) = read_pages(path)
    assert duration is None
    assert image.shape == (400, 600, 3)
