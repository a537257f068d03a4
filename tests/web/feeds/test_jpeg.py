"""`decode_jpeg` on JPEGs of untrusted origin."""

from __future__ import annotations

import struct
import tracemalloc

import cv2
import numpy as np
import pytest

from helpers.video_clips import number_in, numbered_image
from ssiam.errors import ArgumentError
from ssiam.web.feeds.pushed import decode_jpeg


def jpeg(image, *parameters):
    return cv2.imencode(".jpg", image, list(parameters))[1].tobytes()


PLAIN = jpeg(numbered_image(99))
PROGRESSIVE = jpeg(numbered_image(99), cv2.IMWRITE_JPEG_PROGRESSIVE, 1)


def _resized(data, marker, width, height):
    """The same bytes with another size in the header."""
    offset = data.index(b"\xff" + bytes([marker])) + 5
    return data[:offset] + struct.pack(">HH", height, width) + data[offset + 4 :]


def _hidden(data):
    """A huge image after a marker without a length, followed by a small one.

    A parser that reads a length after that marker skips the huge image's header.
    """
    at = data.index(b"\xff\xc0")
    huge = _resized(data, 0xC0, 16000, 16000)[at:]
    return data[:at] + b"\xff\x01" + huge + bytes(0xFFC0 - len(huge)) + data[at:]


def _many_scans(data):
    at = data.rindex(b"\xff\xda")
    return data[:at] + data[at:-2] * 40 + data[-2:]


GOOD = [
    ("plain", PLAIN),
    ("progressive", PROGRESSIVE),
    ("low quality", jpeg(numbered_image(99), cv2.IMWRITE_JPEG_QUALITY, 20)),
]


@pytest.mark.parametrize("data", [g[1] for g in GOOD], ids=[g[0] for g in GOOD])
def test_jpeg(data):
    image = decode_jpeg(data)
    assert (image.shape, image.dtype, number_in(image)) == ((96, 160, 3), np.uint8, 99)


def test_a_gray_jpeg_is_decoded_to_three_channels():
    assert decode_jpeg(jpeg(numbered_image(5)[..., 0])).shape == (96, 160, 3)


BAD = [
    # name, bytes, part of the message
    ("nothing", b"", "not a JPEG"),
    ("text", b"hello " * 99, "not a JPEG"),
    ("PNG", cv2.imencode(".png", numbered_image(1))[1].tobytes(), "not a JPEG"),
    ("BMP", cv2.imencode(".bmp", numbered_image(1))[1].tobytes(), "not a JPEG"),
    ("only the beginning", b"\xff\xd8", "no readable header"),
    ("no frame", PLAIN[:2] + PLAIN[PLAIN.index(b"\xff\xda") :], "no readable header"),
    ("65500 x 65500", _resized(PLAIN, 0xC0, 65500, 65500), "65500x65500 pixels"),
    ("progressive 65500", _resized(PROGRESSIVE, 0xC2, 65500, 65500), "65500x65500 pixels"),
    ("just too many", _resized(PLAIN, 0xC0, 4097, 4096), "4097x4096 pixels"),
    ("no height", _resized(PLAIN, 0xC0, 160, 0), "160x0 pixels"),
    ("hidden size", _hidden(PLAIN), "no readable header"),
    ("many scans", _many_scans(PROGRESSIVE), "scans"),
    ("cut", PLAIN[:-100], "is truncated"),
    ("header only", PLAIN[: PLAIN.index(b"\xff\xda")] + b"\xff\xd9", "is damaged"),
]


@pytest.mark.parametrize(("data", "words"), [b[1:] for b in BAD], ids=[b[0] for b in BAD])
def test_invalid_data_is_refused_without_allocating_memory(data, words):
    tracemalloc.start()
    with pytest.raises(ArgumentError, match=words) as caught:
        decode_jpeg(data)
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert "\n" not in str(caught.value)


def test_limit_pixels():
    assert decode_jpeg(PLAIN, limit_pixels=160 * 96).shape == (96, 160, 3)
    with pytest.raises(ArgumentError, match="at most 15359"):
        decode_jpeg(PLAIN, limit_pixels=160 * 96 - 1)


@pytest.mark.parametrize("data", [PLAIN, PROGRESSIVE], ids=["plain", "progressive"])
def test_a_truncated_jpeg_is_refused(data):
    for length in range(0, len(data), 7):
        with pytest.raises(ArgumentError):
            decode_jpeg(data[:length])


@pytest.mark.parametrize("data", [PLAIN, PROGRESSIVE], ids=["plain", "progressive"])
def test_a_damaged_jpeg_is_decoded_or_refused(data):
    random = np.random.default_rng(5)
    for _ in range(300):
        damaged = bytearray(data)
        for offset in random.integers(0, len(data), random.integers(1, 12)):
            damaged[offset] = random.integers(0, 256)
        try:
            image = decode_jpeg(bytes(damaged), limit_pixels=1_000_000)
        except ArgumentError:
            continue
        assert image.dtype == np.uint8
        assert image.size <= 3_000_000


def test_random_bytes_after_the_start_marker_are_refused():
    random = np.random.default_rng(6)
    for length in range(0, 3000, 37):
        with pytest.raises(ArgumentError):
            decode_jpeg(b"\xff\xd8\xff" + random.bytes(length) + b"\xff\xd9")
