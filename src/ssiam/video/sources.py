"""`open_source`: one argument for every kind of source."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from fractions import Fraction
from io import BufferedReader
from pathlib import Path
from typing import cast
from urllib.parse import unquote, urlsplit

from ssiam.errors import SourceError
from ssiam.video.addresses import is_address, open_address
from ssiam.video.cameras import open_camera
from ssiam.video.containers import Input, open_container
from ssiam.video.folders import open_folder
from ssiam.video.frames import Source
from ssiam.video.pipes import Pipe

STDIN = "-"

_CAMERA = re.compile(r"(?:/dev/video)?([0-9]{1,3})")


@dataclass(frozen=True)
class RawFormat:
    """How headerless frames are laid out.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    size_wh : (int, int)
        Width and height, pixels.
    pixel_format : str
        FFmpeg's name of the layout: bgr24, rgb24, gray, yuv420p, nv12, ...
    fps : Fraction
        Frames a second.
    """

    size_wh: tuple[int, int]
    pixel_format: str = "bgr24"
    fps: Fraction = Fraction(30)

    def options(self) -> dict[str, str]:
        """The options of FFmpeg's raw video reader."""
        width, height = self.size_wh
        rate = Fraction(self.fps).limit_denominator(1_000_000)
        return {
            "video_size": f"{width}x{height}",
            "pixel_format": self.pixel_format,
            "framerate": f"{rate.numerator}/{rate.denominator}",
        }


def open_source(spec: str | int | Path, *, raw: RawFormat | None = None) -> Source:
    """The frames of a video file, folder of images, camera, address or of standard input.

    Parameters
    ----------
    spec : str, int or Path
        A video file; a folder of images; the number of a camera, from 0; an address
        (``rtsp://``, ``http://``, ...); ``"-"`` for standard input. A file named like a
        number is given as ``./0``.
    raw : RawFormat or None
        Set for headerless frames, in a file or from standard input.

    Returns
    -------
    Source
        Iterator of `Frame` and context manager.

    Raises
    ------
    SourceError
        If it cannot be opened or holds no frame; one line that names it and says what to do.
    """
    if isinstance(spec, int):
        return open_camera(spec)
    text = str(spec)
    camera = camera_number(text)
    if camera is not None:
        return open_camera(camera)
    if text == STDIN:
        return _open_stdin(raw)
    if is_address(text) and not text.lower().startswith("file://"):
        return open_address(text)
    if is_address(text):
        text = unquote(urlsplit(text).path)
    return _open_path(text, raw)


def camera_number(spec: str) -> int | None:
    """Which camera `spec` names, a number from 0 or ``/dev/video0``; None for what is none."""
    camera = _CAMERA.fullmatch(spec)
    return None if camera is None else int(camera[1])


def _open_stdin(raw: RawFormat | None) -> Source:
    if sys.stdin is None or sys.stdin.isatty():
        raise SourceError("standard input: nothing is piped in; use e.g. `... | ssiam track -`")
    stdin = cast(BufferedReader, sys.stdin.buffer)
    given = Input(
        name="standard input",
        file=stdin if stdin.seekable() else Pipe(stdin),
        advice="pipe in y4m, mpegts or matroska, or say how raw frames are laid out",
    )
    return open_container(_with_raw(given, raw))


def _open_path(text: str, raw: RawFormat | None) -> Source:
    path = Path(text)
    try:
        if path.is_dir() and text:
            return open_folder(path)
        if not path.exists() or not text:
            raise SourceError(f"{text or 'empty name'}: no such file or folder; check the path")
        head = _head(path) if path.is_file() else b"?"
    except OSError as error:
        raise SourceError(f"{text}: cannot be read ({error.strerror}); check the path") from None
    if not head:
        raise SourceError(f"{text}: the file is empty; get it again")
    # "file:" keeps a colon or a percent sign in the name from meaning something to FFmpeg.
    given = Input(name=text, file=f"file:{text}", advice=_advice(head))
    return open_container(_with_raw(given, raw))


def _with_raw(given: Input, raw: RawFormat | None) -> Input:
    if raw is None:
        return given
    return Input(
        name=given.name,
        file=given.file,
        format="rawvideo",
        options=raw.options(),
        advice=f"check the raw format {raw}",
    )


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(12)


def _advice(head: bytes) -> str:
    if head[4:8] in (b"ftyp", b"mdat", b"moov", b"wide", b"free"):
        return "it looks truncated: the index of an mp4 lies at its end; get the whole file"
    return "is it a video, and is it whole?"
