"""Declared sizes of images and videos are checked before anything is decoded."""

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.video_clips import write_clip
from ssiam.datasets import read_image
from ssiam.errors import ArgumentError, SourceError
from ssiam.training.data.images import read_unchanged
from ssiam.video import open_source
from ssiam.video.image_sizes import declared_sizes, max_pixels
from ssiam.web.feeds.pushed import decode_jpeg


def _encoded(suffix, width=40, height=30, depth=np.uint8):
    return cv2.imencode(suffix, np.zeros((height, width, 3), depth))[1].tobytes()


def _png_of(width, height):
    """A PNG that declares a size and has no pixels."""
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tiff", ".webp"])
@pytest.mark.parametrize("size_wh", [(40, 30), (1, 300), (513, 2)])
def test_sizes_of_all_formats(suffix, size_wh):
    assert declared_sizes(_encoded(suffix, *size_wh)) == [size_wh]


def test_lossless_webp_and_pages_of_a_tiff():
    quality = [cv2.IMWRITE_WEBP_QUALITY, 101]
    lossless = cv2.imencode(".webp", np.zeros((30, 40, 3), np.uint8), quality)[1]
    assert declared_sizes(lossless.tobytes()) == [(40, 30)]
    pages = [np.zeros((30, 40), np.uint8), np.zeros((7, 9), np.uint16)]
    assert declared_sizes(cv2.imencodemulti(".tiff", pages)[1].tobytes()) == [(40, 30), (9, 7)]


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tiff", ".webp"])
def test_truncated_headers_have_no_size(suffix):
    data = _encoded(suffix)
    for length in range(0, 60, 3):
        assert len(declared_sizes(data[:length])) <= 1


def test_a_png_chunk_that_is_longer_than_the_file_is_not_allocated(tmp_path):
    data = bytearray(_encoded(".png"))
    position = data.index(b"IDAT") - 4
    data[position : position + 4] = struct.pack(">I", 2**31 - 1)
    assert declared_sizes(bytes(data)) == []
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(SourceError, match=r"a\.png: cannot be read as an image"):
        open_source(tmp_path)


@pytest.mark.parametrize("name", ["a.png", "a.jpg"])
def test_a_large_image_of_a_folder_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(_png_of(30_000, 20_000))
    message = "30000x20000 pixels, more than 128000000; if you trust it, set SSIAM_MAX_PIXELS="
    with pytest.raises(SourceError, match=message):
        open_source(tmp_path)
    with pytest.raises(SourceError, match="no frame in it can be decoded"):
        open_source(tmp_path / name)
    with pytest.raises(SourceError, match=message):
        read_unchanged(tmp_path / name)


def test_a_large_image_from_a_browser_is_refused():
    data = bytearray(_encoded(".jpg"))
    marker = data.index(b"\xff\xc0")
    data[marker + 5 : marker + 9] = struct.pack(">HH", 60_000, 60_000)
    with pytest.raises(ArgumentError, match="a JPEG of 60000x60000 pixels"):
        decode_jpeg(bytes(data))


@pytest.mark.parametrize("suffix", [".png", ".tiff", ".bmp", ".webp"])
def test_the_limit_is_a_variable(tmp_path, monkeypatch, suffix):
    (tmp_path / f"a{suffix}").write_bytes(_encoded(suffix))
    monkeypatch.setenv("SSIAM_MAX_PIXELS", "1200")
    with open_source(tmp_path) as source:
        assert source.size_wh == (40, 30)
    monkeypatch.setenv("SSIAM_MAX_PIXELS", "1199")
    with pytest.raises(SourceError, match="has 40x30 pixels, more than 1199"):
        open_source(tmp_path)


def test_the_limit_of_videos(tmp_path, monkeypatch):
    clip = write_clip(tmp_path / "a.mp4", 3)
    with open_source(clip) as source:
        width, height = source.size_wh
    monkeypatch.setenv("SSIAM_MAX_PIXELS", str(width * height - 1))
    with pytest.raises(SourceError, match=f"has {width}x{height} pixels, more than"):
        open_source(clip)


@pytest.mark.parametrize("word", ["many", "0", "-5", "1e9"])
def test_a_limit_that_is_no_number(monkeypatch, word):
    monkeypatch.setenv("SSIAM_MAX_PIXELS", word)
    with pytest.raises(ArgumentError, match="give a number of pixels"):
        max_pixels()


def test_a_sparse_image_is_not_read(tmp_path, monkeypatch):
    """It was read whole, whatever its size."""
    monkeypatch.setenv("SSIAM_MAX_PIXELS", "10000")
    path = tmp_path / "a.png"
    path.write_bytes(_encoded(".png"))
    os.truncate(path, 81_000)
    for read in (lambda: read_image(path), lambda: read_unchanged(path)):
        with pytest.raises(SourceError, match=r"has 81000 bytes.*SSIAM_MAX_PIXELS=10125"):
            read()
    os.truncate(path, 79_000)
    assert read_image(path).shape == (30, 40, 3)
    stack = tmp_path / "a.tiff"
    stack.write_bytes(_encoded(".tiff") + bytes(81_000))
    assert read_image(stack).shape == (30, 40, 3)


@pytest.mark.parametrize("start", [b"\x89PNG\r\n\x1a\n", b"\xff\xd8"])
def test_endless_headers(start):
    """One step for each of these bytes took minutes."""
    fill = bytes(12) if start.startswith(b"\x89") else b"\xff"
    assert declared_sizes(start + fill * 100_000) == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_no_image(tmp_path):
    """Opening it waited for a writer."""
    path = tmp_path / "a.png"
    os.mkfifo(path)
    with pytest.raises(SourceError, match="not an image"):
        read_image(path)
    assert read_unchanged(path) == (b"", None)


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b"])
def test_names_that_no_file_can_have(name):
    with pytest.raises(SourceError, match=r"cannot be read|does not exist"):
        read_image(Path(name))
