"""Pictures on their way to browsers and from them."""

import asyncio
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from helpers.synthetic import generator, world
from ssiam.errors import ArgumentError
from ssiam.geometry import rigid
from ssiam.stabilize import FrameView
from ssiam.video import Frame
from ssiam.web.feeds.pictures import decode_picture
from ssiam.web.server import encoding
from ssiam.web.server.encoding import StepPictures, encode_jpeg
from ssiam.web.server.messages import View
from ssiam.web.step import Step

PICTURE = world(2, (160, 120))
MOST = 4096 * 4096


def decoded(jpeg):
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)


def a_step():
    return Step(
        number=1,
        frame=Frame(0, 0.0, PICTURE),
        targets=(),
        motion=None,
        stab_from_raw=rigid(9, -5, 0.1, (80, 60)),
        stabilize="predict",
        arrived=0.0,
        done=0.0,
        fps=30.0,
        dropped=0,
        playing="playing",
    )


WIDTHS = [(64, (48, 64)), (159, (119, 159)), (160, (120, 160)), (4096, (120, 160))]


@pytest.mark.parametrize(("width", "shape"), WIDTHS)
def test_pictures_are_never_wider_than_wanted_nor_than_they_are(width, shape):
    assert decoded(encode_jpeg(PICTURE, width, 80)).shape[:2] == shape


def test_a_strip_keeps_a_row():
    assert decoded(encode_jpeg(np.zeros((2, 4000, 3), np.uint8), 64, 80)).shape == (1, 64, 3)


def test_quality_is_worth_bytes():
    sizes = [len(encode_jpeg(PICTURE, 160, quality)) for quality in (30, 80, 95)]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[2] / 2


def test_each_picture_is_made_once_for_all(monkeypatch):
    made = []

    def counted(image, width, quality):
        made.append((width, quality))
        return encode_jpeg(image, width, quality)

    monkeypatch.setattr(encoding, "encode_jpeg", counted)
    views = [View(), View(width=2000), View(raw=False), View(quality=50), View(False, False)]

    async def all_wanted(pool):
        pictures = StepPictures(a_step(), pool)
        gone = asyncio.ensure_future(pictures.wanted(views[0]))
        await asyncio.sleep(0)
        gone.cancel()  # does not take the others' pictures along
        return await asyncio.gather(*(pictures.wanted(view) for view in views))

    with ThreadPoolExecutor(2) as pool:
        full, wide, steadied, cheap, nothing = asyncio.run(all_wanted(pool))
    assert sorted(made) == [(160, 50), (160, 50), (160, 80), (160, 80)]
    assert [name for name, _ in full] == ["raw", "steadied"]
    assert wide == full
    assert steadied == full[1:]
    assert cheap != full
    assert nothing == []
    rendered = FrameView(PICTURE, a_step().stab_from_raw).render()
    assert np.abs(decoded(full[1][1]).astype(int) - rendered).mean() < 6
    assert np.abs(decoded(full[0][1]).astype(int) - PICTURE).mean() < 6


def jpeg_of(size_wh, **options):
    width, height = size_wh
    parameters = [v for pair in options.items() for v in (getattr(cv2, pair[0]), pair[1])]
    picture = np.full((height, width, 3), 90, np.uint8)
    return cv2.imencode(".jpg", picture, parameters)[1].tobytes()


@pytest.mark.parametrize("options", [{}, {"IMWRITE_JPEG_PROGRESSIVE": 1}])
def test_a_browsers_picture_is_read(options):
    image = decode_picture(jpeg_of((70, 50), **options), MOST)
    assert image.shape == (50, 70, 3)
    assert image.dtype == np.uint8


def claiming(width, height):
    """A small JPEG whose header says that it is of another size."""
    jpeg = bytearray(jpeg_of((16, 16)))
    at = jpeg.index(b"\xff\xc0")
    jpeg[at + 5 : at + 9] = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    return bytes(jpeg)


PNG = cv2.imencode(".png", PICTURE)[1].tobytes()
USELESS = [
    ("empty", b""),
    ("text", b"hello"),
    ("png", PNG),
    ("only the mark", b"\xff\xd8"),
    ("no frame", b"\xff\xd8" + b"\xff\xe0\x00\x02" * 1000),
    ("only filling", b"\xff\xd8" + b"\xff" * 5000),
    ("length 0", b"\xff\xd8" + b"\xff\xe0\x00\x00" * 10),
    ("only a header", jpeg_of((64, 64))[:200]),
    ("of gigabytes", claiming(65535, 65535)),
    ("of no pixels", claiming(0, 16)),
    ("a pixel too much", jpeg_of((65, 64))),
]


@pytest.mark.parametrize("jpeg", [u[1] for u in USELESS], ids=[u[0] for u in USELESS])
def test_what_is_no_picture_is_refused_in_one_line(jpeg):
    with pytest.raises(ArgumentError) as caught:
        decode_picture(jpeg, 64 * 64)
    assert "\n" not in str(caught.value)


def test_damaged_pictures_are_read_or_refused():
    r = generator(5)
    whole = encode_jpeg(PICTURE, 160, 80)
    outcomes = set()
    for _ in range(300):
        damaged = bytearray(whole)
        for at in r.integers(0, len(damaged), 3):
            damaged[at if r.random() < 0.5 else at % 600] = r.integers(256)
        try:
            assert decode_picture(bytes(damaged), MOST).size <= 3 * MOST
            outcomes.add("read")
        except ArgumentError:
            outcomes.add("refused")
    assert outcomes == {"read", "refused"}
