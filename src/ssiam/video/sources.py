"""`open_source`: files, folders, cameras, network addresses and standard input as a `Source`."""

from __future__ import annotations

import re
import sys
import time
from dataclasses import dataclass, replace
from fractions import Fraction
from io import BufferedReader
from pathlib import Path
from typing import cast
from urllib.parse import unquote, urlsplit

import cv2
import numpy as np

from ssiam.addresses import display_name, is_address, redact_address
from ssiam.errors import SourceError, StreamError
from ssiam.video.containers import Input, Pipe, Position, open_container
from ssiam.video.frames import Source, TimedImages
from ssiam.video.images import is_stack, open_folder, open_stack
from ssiam.video.levels import Levels

STDIN = "-"

_CAMERA = re.compile(r"(?:/dev/video)?([0-9]{1,3})")
# Frames per second of a camera whose driver reports no plausible rate.
_CAMERA_FPS = Fraction(30)
# Seconds until a server that does not answer, or that stops sending, counts as disconnected.
_OPEN_TIMEOUT = 10.0
_READ_TIMEOUT = 10.0
_ADDRESS_ADVICE = "write an address as SCHEME://HOST/PATH, without blanks and quotes before it"


@dataclass(frozen=True)
class RawFormat:
    """Layout of headerless frames.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    size_wh : (int, int)
        Width and height, pixels.
    pixel_format : str
        FFmpeg's name of the pixel format: bgr24, rgb24, gray, yuv420p, nv12, ...
    fps : Fraction
        Frames per second.
    """

    size_wh: tuple[int, int]
    pixel_format: str = "bgr24"
    fps: Fraction = Fraction(30)

    def options(self) -> dict[str, str]:
        """Options for FFmpeg's raw video demuxer."""
        width, height = self.size_wh
        rate = Fraction(self.fps).limit_denominator(1_000_000)
        return {
            "video_size": f"{width}x{height}",
            "pixel_format": self.pixel_format,
            "framerate": f"{rate.numerator}/{rate.denominator}",
        }


@dataclass(frozen=True)
class _Options:
    """The options of `open_source` that not every kind of source supports."""

    stream: int | None
    levels: Levels | None
    sound: bool
    position: Position | None = None

    def check_no_stream(self, name: str) -> None:
        if self.stream is not None:
            raise SourceError(
                f"{name}: has no video streams to choose from; omit the stream {self.stream}"
            )


def open_source(
    spec: str | int | Path,
    *,
    raw: RawFormat | None = None,
    stream: int | None = None,
    levels: tuple[float, float] | None = None,
    sound: bool = False,
) -> Source:
    """Open a video file, folder of images, camera, network address or standard input.

    Parameters
    ----------
    spec : str, int or Path
        A video file, a multi-page TIFF or an animated WebP; a folder of images; the index of a
        camera, from 0; an address (``rtsp://``, ``http://``, ...); ``"-"`` for standard input.
        Give a file whose name is a number as ``./0``.
    raw : RawFormat or None
        Layout of headerless frames, in a file or from standard input.
    stream : int or None
        Index of the video stream, from 0; None for the one with the most pixels.
    levels : (low, high) or None
        The values that become 0 and 255, for sources with more than 8 bits per value; None
        estimates them from the first frames, once for the whole source.
    sound : bool
        Whether to keep the audio packets for a `VideoSink` to copy (`SourceInfo.sound`). If
        nothing consumes them, memory use grows with the length of the source.

    Returns
    -------
    Source
        Iterator of `Frame` and context manager.

    Raises
    ------
    SourceError
        It cannot be opened or contains no frame; one line that names it and says what to do.
    ArgumentError
        `levels` are not two values, the darker one first.
    """
    options = _Options(stream, None if levels is None else Levels(*levels), sound)
    if isinstance(spec, int):
        return _open_camera(spec, options)
    text = str(spec)
    camera = camera_index(text)
    if camera is not None:
        _check_not_a_path(text, camera)
        return _open_camera(camera, options)
    if text == STDIN:
        return _open_stdin(raw, options)
    if is_address(text) and not text.lower().startswith("file://"):
        return open_address(text, stream=stream, levels=options.levels, sound=sound)
    if is_address(text):
        text = path_of_file_address(text)
    return _open_path(text, raw, options)


def open_file_at(
    path: str,
    position: Position,
    *,
    raw: RawFormat | None = None,
    stream: int | None = None,
    levels: tuple[float, float] | None = None,
) -> Source:
    """`Source` of a video file from the last key frame before a time on.

    Parameters
    ----------
    path : str
        A video file; not a folder or a file of images.
    position : Position
    raw, stream, levels
        As for `open_source`; levels must be given for more than 8 bits per value.

    Returns
    -------
    Source
        Its frames count from 0 at the key frame; their times are those of the whole file.

    Raises
    ------
    SourceError
        The file cannot be opened or positioned.
    """
    options = _Options(stream, None if levels is None else Levels(*levels), False, position)
    return _open_path(path, raw, options)


def path_of_file_address(address: str) -> str:
    """The path of a ``file://`` address; empty if it has none."""
    try:
        return unquote(urlsplit(address).path)
    except ValueError:  # of a host in brackets that is no IPv6 address
        return ""


def camera_index(spec: str) -> int | None:
    """Index of the camera that `spec` names, ``0`` or ``/dev/video0``; None for other sources."""
    camera = _CAMERA.fullmatch(spec)
    return None if camera is None else int(camera[1])


def _check_not_a_path(text: str, camera: int) -> None:
    """Raise `SourceError` for the name of a file or folder that also means a missing camera."""
    if not _has_camera(camera) and Path(text).exists() and not text.startswith("/dev/"):
        raise SourceError(
            f"{text}: means camera {camera}, which there is not; for the file or folder of that "
            f"name give ./{text}"
        )


def _has_camera(index: int) -> bool:
    return sys.platform != "linux" or Path(f"/dev/video{index}").exists()


def _open_camera(index: int, options: _Options) -> Source:
    name = f"camera {index}"
    options.check_no_stream(name)
    if options.levels is not None:
        raise SourceError(f"{name}: has 8 bits per value; omit the levels")
    if index < 0 or not _has_camera(index):
        raise SourceError(f"{name}: there is no such camera ({_available_cameras()})")
    # OpenCV and not PyAV, because it opens cameras by number on every system.
    capture = cv2.VideoCapture(index)
    if not capture.isOpened():
        raise SourceError(
            f"{name}: cannot be opened; is it connected, not in use, and allowed for this user?"
        )
    # Drivers queue frames; a tracker that lags behind needs the newest one.
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    return open_capture(name, capture)


def open_capture(name: str, capture: cv2.VideoCapture) -> Source:
    """`Source` of an opened OpenCV capture without an end; times are times of arrival."""
    rate = capture.get(cv2.CAP_PROP_FPS)
    fps = Fraction(rate).limit_denominator(1001) if 1 <= rate <= 1000 else _CAMERA_FPS
    return Source(name, _captured(name, capture), fps=fps, length=None)


def _captured(name: str, capture: cv2.VideoCapture) -> TimedImages:
    count = 0
    started = 0.0
    try:
        while True:
            has_image, image = capture.read()
            if not has_image:
                break
            now = time.monotonic()
            started = started if count else now
            yield now - started, np.asarray(image, dtype=np.uint8)
            count += 1
    finally:
        capture.release()
    if not count:
        raise SourceError(f"{name}: opens but delivers no frame; is another program using it?")
    raise StreamError(f"{name}: broke off after {count} frames; was it unplugged?")


def _available_cameras() -> str:
    found = sorted(path.name[5:] for path in Path("/dev").glob("video[0-9]*"))
    return f"available cameras: {', '.join(found)}" if found else "no camera is connected"


def open_address(
    address: str,
    *,
    read_timeout: float = _READ_TIMEOUT,
    stream: int | None = None,
    levels: Levels | None = None,
    sound: bool = False,
) -> Source:
    """`Source` of a network address; RTSP goes over TCP, which loses no packets.

    After `read_timeout` seconds without data the source breaks off. The other parameters are
    those of `open_source`.
    """
    options = {"rtsp_transport": "tcp"} if address.lower().startswith("rtsp") else {}
    return open_container(
        Input(
            name=redact_address(address),
            file=address,
            options=options,
            timeout=(_OPEN_TIMEOUT, read_timeout),
            advice="check the address (in a password, write # as %23 and ? as %3F) and that "
            "the server is up",
            stream=stream,
            levels=levels,
            sound=sound,
            is_remote=True,
        )
    )


def _open_stdin(raw: RawFormat | None, options: _Options) -> Source:
    if sys.stdin is None or sys.stdin.isatty():
        raise SourceError("standard input: nothing is piped in; use e.g. `... | ssiam track -`")
    stdin = cast(BufferedReader, sys.stdin.buffer)
    given = Input(
        name="standard input",
        file=stdin if stdin.seekable() else Pipe(stdin),
        advice="pipe in y4m, mpegts or matroska, or give the layout of raw frames",
    )
    return open_container(_with_options(given, raw, options))


def _open_path(text: str, raw: RawFormat | None, options: _Options) -> Source:
    path, name = Path(text), display_name(text)
    if "\0" in text:
        raise SourceError(f"{name!r}: has a NUL character; check the path")
    try:
        if path.is_dir() and text:
            options.check_no_stream(text)
            return open_folder(path, levels=options.levels)
        if not path.exists() or not text:
            advice = "check the path" if name == text else _ADDRESS_ADVICE
            raise SourceError(f"{name or 'empty name'}: no such file or folder; {advice}")
        head = _head(path) if path.is_file() else b"?"
    except OSError as error:
        raise SourceError(f"{name}: cannot be read ({error.strerror}); check the path") from None
    if not head:
        raise SourceError(f"{text}: the file is empty; get it again")
    if raw is None and is_stack(head):
        options.check_no_stream(text)
        return open_stack(path, levels=options.levels)
    # "file:" keeps FFmpeg from interpreting a colon or a percent sign in the name.
    given = Input(name=text, file=f"file:{text}", advice=_advice(head))
    return open_container(_with_options(given, raw, options))


def _with_options(given: Input, raw: RawFormat | None, options: _Options) -> Input:
    given = replace(
        given,
        stream=options.stream,
        levels=options.levels,
        sound=options.sound,
        position=options.position,
    )
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
        return "it looks truncated: the index of an mp4 may be at its end; get the whole file"
    return "is it a video, and is it complete?"
