"""`open_source`: one argument for every kind of source."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, replace
from fractions import Fraction
from io import BufferedReader
from pathlib import Path
from typing import cast
from urllib.parse import unquote, urlsplit

from ssiam.errors import SourceError
from ssiam.video.addresses import is_address, open_address
from ssiam.video.cameras import open_camera
from ssiam.video.containers import Input, open_container
from ssiam.video.folders import open_folder, open_stack
from ssiam.video.frames import Source
from ssiam.video.images import is_stack
from ssiam.video.levels import Levels
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


def open_source(
    spec: str | int | Path,
    *,
    raw: RawFormat | None = None,
    stream: int | None = None,
    levels: tuple[float, float] | None = None,
    sound: bool = False,
) -> Source:
    """The frames of a video file, folder of images, camera, address or of standard input.

    Parameters
    ----------
    spec : str, int or Path
        A video file, a TIFF of several pages or an animated WebP; a folder of images; the number
        of a camera, from 0; an address (``rtsp://``, ``http://``, ...); ``"-"`` for standard
        input. A file named like a number is given as ``./0``.
    raw : RawFormat or None
        Set for headerless frames, in a file or from standard input.
    stream : int or None
        Which of several video streams, from 0; None for the one with the most pixels.
    levels : (low, high) or None
        The values that become 0 and 255, of sources with more than 8 bits a value; None takes
        them from the first frames, once for the whole source.
    sound : bool
        Whether to keep the sound for a `VideoSink` to copy (`SourceFacts.sound`); without
        anybody who takes it, memory grows.

    Returns
    -------
    Source
        Iterator of `Frame` and context manager.

    Raises
    ------
    SourceError
        If it cannot be opened or holds no frame; one line that names it and says what to do.
    ArgumentError
        `levels` are no two values, the darker one first.
    """
    chosen = _Chosen(stream, None if levels is None else Levels(*levels), sound)
    if isinstance(spec, int):
        return _open_camera(spec, chosen)
    text = str(spec)
    camera = camera_number(text)
    if camera is not None:
        return _open_camera(camera, chosen)
    if text == STDIN:
        return _open_stdin(raw, chosen)
    if is_address(text) and not text.lower().startswith("file://"):
        return open_address(text, stream=stream, levels=chosen.levels, sound=sound)
    if is_address(text):
        text = unquote(urlsplit(text).path)
    return _open_path(text, raw, chosen)


@dataclass(frozen=True)
class _Chosen:
    """The choices of `open_source` that only some kinds of source have."""

    stream: int | None
    levels: Levels | None
    sound: bool

    def check_single_stream(self, name: str) -> None:
        if self.stream is not None:
            raise SourceError(
                f"{name}: has no video streams to choose from; leave out the stream {self.stream}"
            )


def camera_number(spec: str) -> int | None:
    """Which camera `spec` names, a number from 0 or ``/dev/video0``; None for what is none."""
    camera = _CAMERA.fullmatch(spec)
    return None if camera is None else int(camera[1])


def _open_camera(index: int, chosen: _Chosen) -> Source:
    chosen.check_single_stream(f"camera {index}")
    if chosen.levels is not None:
        raise SourceError(f"camera {index}: has 8 bits a value; leave out the levels")
    return open_camera(index)


def _open_stdin(raw: RawFormat | None, chosen: _Chosen) -> Source:
    if sys.stdin is None or sys.stdin.isatty():
        raise SourceError("standard input: nothing is piped in; use e.g. `... | ssiam track -`")
    stdin = cast(BufferedReader, sys.stdin.buffer)
    given = Input(
        name="standard input",
        file=stdin if stdin.seekable() else Pipe(stdin),
        advice="pipe in y4m, mpegts or matroska, or say how raw frames are laid out",
    )
    return open_container(_completed(given, raw, chosen))


def _open_path(text: str, raw: RawFormat | None, chosen: _Chosen) -> Source:
    path = Path(text)
    try:
        if path.is_dir() and text:
            chosen.check_single_stream(text)
            return open_folder(path, levels=chosen.levels)
        if not path.exists() or not text:
            raise SourceError(f"{text or 'empty name'}: no such file or folder; check the path")
        head = _head(path) if path.is_file() else b"?"
    except OSError as error:
        raise SourceError(f"{text}: cannot be read ({error.strerror}); check the path") from None
    if not head:
        raise SourceError(f"{text}: the file is empty; get it again")
    if raw is None and is_stack(head):
        chosen.check_single_stream(text)
        return open_stack(path, levels=chosen.levels)
    # "file:" keeps a colon or a percent sign in the name from meaning something to FFmpeg.
    given = Input(name=text, file=f"file:{text}", advice=_advice(head))
    return open_container(_completed(given, raw, chosen))


def _completed(given: Input, raw: RawFormat | None, chosen: _Chosen) -> Input:
    """What is to be opened, with the choices of `open_source`."""
    given = replace(given, stream=chosen.stream, levels=chosen.levels, sound=chosen.sound)
    if raw is None:
        return given
    return replace(
        given, format="rawvideo", options=raw.options(), advice=f"check the raw format {raw}"
    )


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(32)


def _advice(head: bytes) -> str:
    if head[4:8] in (b"ftyp", b"mdat", b"moov", b"wide", b"free"):
        return "it looks truncated: the index of an mp4 lies at its end; get the whole file"
    return "is it a video, and is it whole?"
