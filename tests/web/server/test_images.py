"""JPEG images to browsers and from their cameras."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from helpers.live_clients import Client
from helpers.live_server import serving, until
from helpers.synthetic import generator, world
from ssiam.errors import ArgumentError
from ssiam.geometry import rigid
from ssiam.stabilize import FrameView
from ssiam.video import Frame
from ssiam.web.feeds.pushed import decode_jpeg
from ssiam.web.server import images
from ssiam.web.server.images import StepImages, encode_jpeg
from ssiam.web.server.incoming import View
from ssiam.web.server.limits import ServerLimits
from ssiam.web.types import Step

IMAGE = world(2, (160, 120))
MAX_PIXELS = 4096 * 4096


def decoded(jpeg):
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)


def make_step():
    return Step(
        number=1,
        frame=Frame(0, 0.0, IMAGE),
        targets=(),
        motion=None,
        stab_from_raw=rigid(9, -5, 0.1, (80, 60)),
        stabilize="predict",
        arrived=0.0,
        done=0.0,
        fps=30.0,
        dropped=0,
        playback="playing",
    )


WIDTHS = [(64, (48, 64)), (159, (119, 159)), (160, (120, 160)), (4096, (120, 160))]


@pytest.mark.parametrize(("width", "shape"), WIDTHS)
def test_images_are_scaled_down_only(width, shape):
    assert decoded(encode_jpeg(IMAGE, width, 80)).shape[:2] == shape


def test_a_thin_image_keeps_a_row():
    assert decoded(encode_jpeg(np.zeros((2, 4000, 3), np.uint8), 64, 80)).shape == (1, 64, 3)


def test_a_higher_quality_needs_more_bytes():
    sizes = [len(encode_jpeg(IMAGE, 160, quality)) for quality in (30, 80, 95)]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[2] / 2


def test_each_image_is_encoded_once_for_all_clients(monkeypatch):
    encoded = []

    def counting(image, width, quality):
        encoded.append((width, quality))
        return encode_jpeg(image, width, quality)

    monkeypatch.setattr(images, "encode_jpeg", counting)
    views = [View(), View(width=2000), View(raw=False), View(quality=50), View(False, False)]

    async def encode_all(pool):
        step_images = StepImages(make_step(), pool)
        cancelled = asyncio.ensure_future(step_images.encoded(views[0]))
        await asyncio.sleep(0)
        cancelled.cancel()  # must not cancel the others
        return await asyncio.gather(*(step_images.encoded(view) for view in views))

    with ThreadPoolExecutor(2) as pool:
        full, wide, stabilized, low, none = asyncio.run(encode_all(pool))
    assert sorted(encoded) == [(160, 50), (160, 50), (160, 80), (160, 80)]
    assert [name for name, _ in full] == ["raw", "steadied"]
    assert wide == full
    assert stabilized == full[1:]
    assert low != full
    assert none == []
    rendered = FrameView(IMAGE, make_step().stab_from_raw).render()
    assert np.abs(decoded(full[1][1]).astype(int) - rendered).mean() < 6
    assert np.abs(decoded(full[0][1]).astype(int) - IMAGE).mean() < 6


def jpeg_of(size_wh, **options):
    width, height = size_wh
    parameters = [v for pair in options.items() for v in (getattr(cv2, pair[0]), pair[1])]
    image = np.full((height, width, 3), 90, np.uint8)
    return cv2.imencode(".jpg", image, parameters)[1].tobytes()


@pytest.mark.parametrize("options", [{}, {"IMWRITE_JPEG_PROGRESSIVE": 1}])
def test_a_jpeg_is_decoded(options):
    image = decode_jpeg(jpeg_of((70, 50), **options), MAX_PIXELS)
    assert image.shape == (50, 70, 3)
    assert image.dtype == np.uint8


def with_header_size(width, height):
    """A small JPEG with another size in its header."""
    jpeg = bytearray(jpeg_of((16, 16)))
    at = jpeg.index(b"\xff\xc0")
    jpeg[at + 5 : at + 9] = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    return bytes(jpeg)


PNG = cv2.imencode(".png", IMAGE)[1].tobytes()
INVALID = [
    ("empty", b""),
    ("text", b"hello"),
    ("png", PNG),
    ("only the start marker", b"\xff\xd8"),
    ("no frame", b"\xff\xd8" + b"\xff\xe0\x00\x02" * 1000),
    ("only fill bytes", b"\xff\xd8" + b"\xff" * 5000),
    ("length 0", b"\xff\xd8" + b"\xff\xe0\x00\x00" * 10),
    ("only a header", jpeg_of((64, 64))[:200]),
    ("gigabytes", with_header_size(65535, 65535)),
    ("no pixels", with_header_size(0, 16)),
    ("too many pixels", jpeg_of((65, 64))),
]


@pytest.mark.parametrize("jpeg", [i[1] for i in INVALID], ids=[i[0] for i in INVALID])
def test_an_invalid_jpeg_is_refused_in_one_line(jpeg):
    with pytest.raises(ArgumentError) as caught:
        decode_jpeg(jpeg, 64 * 64)
    assert "\n" not in str(caught.value)


def test_a_damaged_jpeg_is_decoded_or_refused():
    r = generator(5)
    original = encode_jpeg(IMAGE, 160, 80)
    outcomes = set()
    for _ in range(300):
        damaged = bytearray(original)
        for at in r.integers(0, len(damaged), 3):
            damaged[at if r.random() < 0.5 else at % 600] = r.integers(256)
        try:
            assert decode_jpeg(bytes(damaged), MAX_PIXELS).size <= 3 * MAX_PIXELS
            outcomes.add("decoded")
        except ArgumentError:
            outcomes.add("refused")
    assert outcomes == {"decoded", "refused"}


def test_only_one_client_is_the_source():
    with serving(webcam=True) as live, Client(live) as client, Client(live) as other:
        assert client.next("hello")["size"] is None
        client.socket.send(encode_jpeg(world(3, (200, 100)), 200, 90))
        _, images = client.next("step")
        assert images["raw"].shape == (100, 200, 3)
        other.socket.send(encode_jpeg(world(3, (200, 100)), 200, 90))
        assert other.next("error")["code"] == "not-possible"
        client.socket.send(b"\xff\xd8 not an image")
        assert client.next("error")["code"] == "bad-message"
        client.close()
        until(lambda: live.clients == 1)
        other.socket.send(encode_jpeg(world(3, (300, 100)), 300, 90))
        while other.next("step")[1]["raw"].shape != (100, 300, 3):
            pass


TOO_LARGE = [("image", b"\xff\xd8" + bytes(90_000)), ("text", "x" * 70_000)]


@pytest.mark.parametrize("message", [t[1] for t in TOO_LARGE], ids=[t[0] for t in TOO_LARGE])
def test_messages_of_the_source_are_limited_in_size(message):
    limits = ServerLimits(image_bytes=80_000)
    with serving(webcam=True, limits=limits) as live, Client(live) as client:
        client.socket.send(message)
        assert client.close_code() == 1009
