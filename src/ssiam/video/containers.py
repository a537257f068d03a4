"""`open_container`: the frames of any video that FFmpeg can open, through PyAV."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field
from fractions import Fraction
from io import BufferedReader
from itertools import islice, pairwise
from statistics import median
from typing import Any

import av
from av.codec.context import ThreadType
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from ssiam.errors import SourceError, SsiamError, StreamError
from ssiam.video.decoding import DEFAULT_FPS, Decoder, TimeSource
from ssiam.video.frames import DecodedImages, Source, SourceInfo
from ssiam.video.image_sizes import check_pixels, max_pixels
from ssiam.video.levels import LEVEL_FRAMES, Levels, convert_to_8bit
from ssiam.video.sound import Sound
from ssiam.video.truncation import TruncationCheck

# Decoder threads for recordings: the next frame is decoded while this one is tracked. Each
# thread holds one more frame in memory and adds a delay of one frame, so live streams get one.
_RECORDING_THREADS = 2
# Formats that announce no end: only the damage flags of their frames reveal a truncation, and
# decoder threads lose those flags.
_BROADCAST = ("mpegts", "mpeg")
# FFmpeg's demuxer of text art accepts any .txt as a video.
_NOT_VIDEO = ("tty",)
# Still images: covers of music, thumbnails of a chapter list.
_NOT_MOVING = Disposition.attached_pic | Disposition.timed_thumbnails
# Number of frames from which the rate is measured if the container gives none.
_MEASURED_FRAMES = 6
# Nominal and average rate further apart than this share mean a variable frame rate.
_RATE_TOLERANCE = 0.05
# Frames per second. FFmpeg reports the clock ticks, 1000 and more, as the nominal rate of streams
# whose times it cannot interpret; for faster cameras it also reports an average.
_HIGHEST_NOMINAL = 480
# FFmpeg's AVFMT_NOTIMESTAMPS, of demuxers whose format has no timestamps.
_NO_TIMESTAMPS = 0x0080
# Name suffixes of FFmpeg's image demuxers, which assume 25 images per second.
_IMAGE_DEMUXERS = ("_pipe", "image2", "image2pipe")
# A title in an unknown encoding must not make a file unreadable. PyAV 19 needs no option for that.
_METADATA: dict[str, Any] = (
    {"metadata_errors": "replace"} if int(av.__version__.split(".")[0]) < 19 else {}
)


class Pipe:
    """A byte stream that cannot seek; `count` is the number of bytes read.

    A Python object, because FFmpeg's own pipe would not react to Ctrl-C. PyAV swallows exceptions
    raised in `read`, so Ctrl-C ends the data there and `check_interrupted` raises it afterwards.
    """

    def __init__(self, file: BufferedReader) -> None:
        self._file = file
        self._interrupted = False
        self.count = 0

    def read(self, size: int) -> bytes:
        """Available data, at most `size` bytes; empty at the end."""
        try:
            # Not `read`, which would wait for all `size` bytes of a slow stream.
            data = self._file.read1(size)
        except KeyboardInterrupt:
            self._interrupted = True
            return b""
        self.count += len(data)
        return data

    def check_interrupted(self) -> None:
        """Raise `KeyboardInterrupt` if one occurred while waiting for data."""
        if self._interrupted:
            raise KeyboardInterrupt


@dataclass(frozen=True)
class Position:
    """Where to start decoding: at the last key frame before a time.

    Attributes
    ----------
    seconds : float
        Seconds since `origin`.
    origin : Fraction
        Time of the first frame by the clock of the container, seconds.
    """

    seconds: float
    origin: Fraction


@dataclass(frozen=True)
class Input:
    """Input for PyAV.

    Attributes
    ----------
    name : str
        Name in messages.
    file : str or file-like
        A URL, or an object with a `read` method.
    format : str or None
        FFmpeg's name of the format; None detects it.
    options : dict of str to str
        Options for FFmpeg's demuxer.
    timeout : (float, float) or None
        Seconds until opening and reading fail.
    advice : str
        What to do if it cannot be opened; ends the message.
    stream : int or None
        Index among the video streams, from 0, cover images not counted; None for the largest.
    levels : Levels or None
        For more than 8 bits per value; None takes them from the first frames.
    sound : bool
        Whether to keep the audio packets (`SourceInfo.sound`).
    is_remote : bool
        Whether it comes over a network, at the pace of the sender.
    position : Position or None
        Where to start; None for the first frame.
    """

    name: str
    file: Any = field(repr=False)
    format: str | None = None
    options: dict[str, str] = field(default_factory=dict)
    timeout: tuple[float, float] | None = None
    advice: str = "is it a video, and is it complete?"
    stream: int | None = None
    levels: Levels | None = None
    sound: bool = False
    is_remote: bool = False
    position: Position | None = None

    @property
    def pipe(self) -> Pipe | None:
        """The file if it is a pipe."""
        return self.file if isinstance(self.file, Pipe) else None

    def check_interrupted(self) -> None:
        """Raise `KeyboardInterrupt` if one occurred while FFmpeg read from a pipe."""
        if self.pipe is not None:
            self.pipe.check_interrupted()


def open_container(given: Input) -> Source:
    """`Source` of a video stream.

    Raises
    ------
    SourceError
        There is no video stream that can be decoded.
    """
    container = _open(given)
    stream = _video_stream(given, container)
    try:
        check_pixels(given.name, stream.width, stream.height)
    except SourceError:
        container.close()
        raise
    stream.codec_context.options = {"max_pixels": str(max_pixels())}
    is_recording = bool(container.duration)
    rate = _frame_rate(stream, is_recording=is_recording)
    fps = rate.fps or DEFAULT_FPS
    if is_recording and container.format.name not in _BROADCAST:
        stream.thread_type = ThreadType.FRAME
        stream.thread_count = _RECORDING_THREADS
    else:
        stream.thread_count = 1
    length = _announced_length(container, stream, fps)
    time_source = _time_source(container, is_remote=given.is_remote)
    info = _source_info(given, container, stream, time_source)
    info.is_variable = info.is_variable or rate.is_variable
    pipe = given.pipe
    bytes_read = None if pipe is None else lambda: pipe.count
    truncation = TruncationCheck(container, stream, fps, bytes_read=bytes_read)
    origin = None if given.position is None else given.position.origin
    decoder = Decoder(container, stream, truncation, info, time_source, origin)
    if given.position is not None:
        _seek(given, container, stream, given.position)
    images = _images(given, decoder, length)
    if rate.fps is None:
        first_times, images = _peeked(images)
        fps = _measured_rate(first_times) or fps
    converted = convert_to_8bit(
        given.name, images, info, given.levels, LEVEL_FRAMES if is_recording else 1
    )
    return Source(given.name, converted, fps=fps, length=length, info=info)


def _open(given: Input) -> InputContainer:
    try:
        container: InputContainer = av.open(
            given.file,
            mode="r",
            format=given.format,
            options={**given.options, "max_pixels": str(max_pixels())},
            timeout=given.timeout,
            **_METADATA,
        )
        return container
    except (av.FFmpegError, OSError, ValueError) as error:
        given.check_interrupted()
        # The cause would print the whole address, with its password.
        raise SourceError(f"{given.name}: {_reason(error)}; {given.advice}") from None


def _seek(given: Input, container: InputContainer, stream: VideoStream, position: Position) -> None:
    if stream.time_base is None:
        raise SourceError(f"{given.name}: has no timestamps to seek by")
    ticks = (Fraction(position.seconds) + position.origin) / stream.time_base
    try:
        container.seek(int(ticks), stream=stream)
    except av.FFmpegError as error:
        container.close()
        raise SourceError(f"{given.name}: cannot be positioned ({_reason(error)})") from None


def _video_stream(given: Input, container: InputContainer) -> VideoStream:
    """The requested stream, else the one with the most pixels that can be decoded."""
    moving = [s for s in container.streams.video if not s.disposition & _NOT_MOVING]
    if not moving or container.format.name in _NOT_VIDEO:
        kind = "only sound" if container.streams.audio else f"no images; {given.advice}"
        container.close()
        raise SourceError(f"{given.name}: has no video stream ({kind})")
    if given.stream is not None and not 0 <= given.stream < len(moving):
        known = ", ".join(f"{i} ({s.width}x{s.height})" for i, s in enumerate(moving))
        container.close()
        raise SourceError(f"{given.name}: has no video stream {given.stream}: give one of {known}")
    # PyAV gives no context where FFmpeg lacks the decoder, and crashes when asked to decode.
    decodable = [s for s in moving if s.codec_context is not None]
    stream = moving[given.stream] if given.stream is not None else None
    if stream is None and decodable:
        stream = max(decodable, key=lambda s: s.width * s.height)
    if stream is None or stream.codec_context is None:
        container.close()
        raise SourceError(f"{given.name}: FFmpeg has no decoder for its video; convert it to H.264")
    return stream


def _announced_length(container: InputContainer, stream: VideoStream, fps: Fraction) -> int | None:
    if stream.frames:
        return stream.frames
    return round(container.duration / av.time_base * fps) if container.duration else None


def _source_info(
    given: Input, container: InputContainer, stream: VideoStream, time_source: TimeSource
) -> SourceInfo:
    info = SourceInfo()
    if given.sound and container.streams.audio:
        info.sound = Sound(container.streams.audio)
    if time_source is TimeSource.STREAM:
        return info
    info.is_variable = time_source is TimeSource.ARRIVAL
    info.is_rate_known = time_source is TimeSource.NONE and bool(stream.codec_context.framerate)
    info.notes.append(
        "has no timestamps: using times of arrival"
        if time_source is TimeSource.ARRIVAL
        else f"has no timestamps: assuming {float(stream.guessed_rate or DEFAULT_FPS):g} frames "
        "per second"
    )
    return info


def _time_source(container: InputContainer, *, is_remote: bool) -> TimeSource:
    """Where the frame times come from.

    The parts of a multipart stream (MJPEG over HTTP), concatenated images and bare H.264 have no
    timestamps; FFmpeg counts them at 25 per second. For a live camera the times of arrival are
    used. Input that arrives faster than it was recorded, such as a file, has no times.
    """
    name = container.format.name
    is_bare = bool(container.format.flags & _NO_TIMESTAMPS) and name != "rawvideo"
    if not is_bare and not name.endswith(_IMAGE_DEMUXERS):
        return TimeSource.STREAM
    is_endless = container.size <= 0
    is_live = is_endless and (is_remote or name == "mpjpeg")
    return TimeSource.ARRIVAL if is_live else TimeSource.NONE


@dataclass(frozen=True)
class _Rate:
    """Frames per second; `fps` is None where it can only be measured."""

    fps: Fraction | None
    is_variable: bool = False


def _frame_rate(stream: VideoStream, *, is_recording: bool) -> _Rate:
    """The nominal rate, or the average one of a recording whose frames have another pace.

    The nominal rate is the lowest one at which every frame has its own tick. An average above it,
    as FFmpeg reports for DV, is ignored.
    """
    nominal, average = stream.guessed_rate, stream.average_rate
    if nominal and average and abs(nominal / average - 1) <= _RATE_TOLERANCE:
        return _Rate(nominal, is_variable=not _is_frame_grid(stream.base_rate, nominal))
    if is_recording and nominal and average and average < nominal:
        return _Rate(average, is_variable=True)
    plausible = [rate for rate in (nominal, average) if rate and rate <= _HIGHEST_NOMINAL]
    return _Rate(plausible[0]) if plausible else _Rate(None, is_variable=True)


def _is_frame_grid(base: Fraction | None, nominal: Fraction) -> bool:
    """Whether the grid of all times is that of the frames or of their fields."""
    return not base or any(abs(base / (n * nominal) - 1) <= _RATE_TOLERANCE for n in (1, 2))


def _measured_rate(times: list[float | None]) -> Fraction | None:
    """Frames per second from the times (seconds) of the first frames; None if undetermined."""
    known = [time for time in times if time is not None]
    gaps = [after - before for before, after in pairwise(known)]
    gap = median(gaps) if gaps else 0.0
    return Fraction(1 / gap).limit_denominator(1001) if gap > 0 else None


def _peeked(images: DecodedImages) -> tuple[list[float | None], DecodedImages]:
    """The times of the first images, and an iterator of all images, the first ones included."""
    peeked: list[Any] = []
    error: SsiamError | None = None
    try:
        peeked.extend(islice(images, _MEASURED_FRAMES))
    except SsiamError as raised:
        error = raised
    times = [time for time, _ in peeked]

    def replayed() -> DecodedImages:
        with closing(images):
            while peeked:  # releases each image
                yield peeked.pop(0)
            if error is not None:
                raise error
            yield from images

    return times, replayed()


def _images(given: Input, decoder: Decoder, length: int | None) -> DecodedImages:
    """Images of a stream to its end; `StreamError` after the last one if it is truncated."""
    count = 0
    fault = None
    with decoder.container, closing(decoder.images()) as images:
        try:
            for image in images:
                yield image
                count += 1
        except (av.FFmpegError, OSError, ValueError) as error:
            fault = _reason(error)
    given.check_interrupted()
    fault = fault or decoder.truncation.fault()
    if fault is None:
        return
    if not count:
        raise SourceError(
            f"{given.name}: no frame in it can be decoded ({fault}); is it truncated?"
        )
    total = f" of {length}" if length and length > count else ""
    raise StreamError(
        f"{given.name}: broke off after {count}{total} frames ({fault}); "
        "get the source again if the rest matters"
    )


def _reason(error: Exception) -> str:
    if isinstance(error, av.error.ExitError):
        return "no data before the timeout"
    text = getattr(error, "strerror", None) or str(error)
    return " ".join(text.split())
