"""Small test videos: every image encodes its number as a row of black and white cells."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

import ssiam
from ssiam.errors import SsiamError

NTSC = Fraction(30000, 1001)
WIDTH, HEIGHT = 160, 96
_BITS, _CELL = 8, 16


def numbered_image(number, width=WIDTH, height=HEIGHT):
    """Moving noise, which does not compress well, with `number` encoded as bits."""
    noise = np.random.default_rng(7).integers(0, 256, (height // 4 + 1, width // 4 + 99, 3))
    moved = noise[:, number % 60 : number % 60 + width // 4 + 1].astype(np.uint8)
    image = np.ascontiguousarray(moved.repeat(4, axis=0).repeat(4, axis=1)[:height, :width])
    for bit in range(_BITS):
        image[:_CELL, bit * _CELL : (bit + 1) * _CELL] = 255 * (number >> bit & 1)
    return image


def number_in(image):
    cells = image[_CELL // 4 : _CELL * 3 // 4, : _BITS * _CELL].reshape(_CELL // 2, _BITS, -1)
    return sum(1 << bit for bit in range(_BITS) if cells[:, bit].mean() > 127)


def write_clip(
    path: Path,
    count: int = 60,
    *,
    rate: Fraction = NTSC,
    codec: str = "libx264",
    seconds: Sequence[float] | None = None,
    size: tuple[int, int] = (WIDTH, HEIGHT),
    format: str | None = None,
    options: dict[str, str] | None = None,
    codec_options: dict[str, str] | None = None,
) -> Path:
    with av.open(str(path), "w", format=format, options=options or {}) as container:
        stream = container.add_stream(codec, rate=rate, options=codec_options or {})
        stream.width, stream.height = size
        stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        # Reproducible bytes: x264 makes one slice per thread.
        stream.thread_count = 1
        base = 1 / rate if seconds is None else Fraction(1, 1000)
        stream.codec_context.time_base = base
        for index in range(count):
            frame = av.VideoFrame.from_ndarray(numbered_image(index, *size), format="bgr24")
            frame.pts = index if seconds is None else round(seconds[index] * 1000)
            frame.time_base = base
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def decoded(path: Path) -> list[av.VideoFrame]:
    """All frames of a file, decoded by PyAV and not by the code under test."""
    with av.open(str(path)) as container:
        return list(container.decode(video=0))


def y4m(numbers: Iterable[int], rate: Fraction = NTSC) -> bytes:
    header = f"YUV4MPEG2 W{WIDTH} H{HEIGHT} F{rate.numerator}:{rate.denominator} Ip A1:1 C420jpeg\n"
    parts = [header.encode()]
    for number in numbers:
        frame = av.VideoFrame.from_ndarray(numbered_image(number), format="bgr24")
        parts += [b"FRAME\n", frame.reformat(format="yuv420p").to_ndarray().tobytes()]
    return b"".join(parts)


def read_all(frames):
    """Numbers of the delivered frames, and the `SsiamError` that ended them, or None."""
    numbers = []
    try:
        for frame in frames:
            numbers.append(number_in(frame.image))
    except SsiamError as error:
        return numbers, error
    return numbers, None


def cut(path: Path, share: float) -> Path:
    """A copy with only this share of the bytes."""
    data = path.read_bytes()
    target = path.with_name(f"cut_{path.name}")
    target.write_bytes(data[: int(len(data) * share)])
    return target


def python(code: str, *args: str, **kwargs) -> subprocess.Popen:
    """Start a Python process that runs `code` with this ssiam."""
    source = str(Path(ssiam.__file__).parents[1])
    paths = [source, str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.Popen([sys.executable, "-c", code, *args], env=env, **kwargs)


def shared(*parts: str) -> Path:
    """A file of the shared data; skips the test if it is missing."""
    default = Path(__file__).parents[3] / "shared"
    path = Path(os.environ.get("SSIAM_SHARED", default)).joinpath(*parts)
    if not path.exists():
        pytest.skip(f"shared data not found: {path} (set SSIAM_SHARED)")
    return path
