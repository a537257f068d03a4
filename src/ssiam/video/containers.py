"""Frames out of anything FFmpeg can open, through PyAV."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import av
from av.codec.context import ThreadType
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from ssiam.errors import SourceError, StreamError
from ssiam.video.decoding import decoded
from ssiam.video.ending import Ending
from ssiam.video.frames import Pictures, Source
from ssiam.video.pipes import Pipe

# Decoder threads for recordings: the next frame is decoded while this one is tracked. Each
# holds one more frame in memory and delays by one, so live streams get a single one.
_RECORDING_THREADS = 2
# Formats that announce no end: only the damage marks of their frames tell that they were cut,
# and decoder threads lose those marks.
_BROADCAST = ("mpegts", "mpeg")
# FFmpeg's demuxer of text art takes any .txt for a video.
_NOT_VIDEO = ("tty",)
# Nominal and average rate further apart than this share mean a variable frame rate.
_RATE_TOLERANCE = 0.05
_DEFAULT_FPS = Fraction(25)
# A title in an unknown encoding must not make a file unreadable; PyAV 19 sees to it by itself.
_METADATA: dict[str, Any] = (
    {"metadata_errors": "replace"} if int(av.__version__.split(".")[0]) < 19 else {}
)


@dataclass(frozen=True)
class Input:
    """What PyAV is to open: `file` a URL or what has a `read`, `name` how messages call it."""

    name: str
    file: Any
    format: str | None = None
    options: dict[str, str] = field(default_factory=dict)
    timeout: tuple[float, float] | None = None
    advice: str = "is it a video, and is it whole?"

    @property
    def pipe(self) -> Pipe | None:
        """The file if it is a pipe."""
        return self.file if isinstance(self.file, Pipe) else None

    def check_interrupted(self) -> None:
        """Raise `KeyboardInterrupt` if one came while FFmpeg read from a pipe."""
        if self.pipe is not None:
            self.pipe.check()


def open_container(given: Input) -> Source:
    """`Source` of the first video stream; `SourceError` if there is none that can be decoded."""
    container = _open(given)
    stream = _video_stream(given, container)
    is_recording = bool(container.duration)
    fps = _frame_rate(stream, is_recording=is_recording)
    if is_recording and container.format.name not in _BROADCAST:
        stream.thread_type = ThreadType.FRAME
        stream.thread_count = _RECORDING_THREADS
    else:
        stream.thread_count = 1
    length = _announced_length(container, stream, fps)
    ending = Ending(container, stream, fps, pipe=given.pipe)
    pictures = _pictures(given, container, stream, ending, length)
    return Source(given.name, pictures, fps=fps, length=length)


def _open(given: Input) -> InputContainer:
    try:
        container: InputContainer = av.open(
            given.file,
            mode="r",
            format=given.format,
            options=given.options,
            timeout=given.timeout,
            **_METADATA,
        )
        return container
    except (av.FFmpegError, OSError, ValueError) as error:
        given.check_interrupted()
        # The cause would print the whole address, with its password.
        raise SourceError(f"{given.name}: {_reason(error)}; {given.advice}") from None


def _video_stream(given: Input, container: InputContainer) -> VideoStream:
    """First video stream that is not the cover picture of a piece of music."""
    moving = (s for s in container.streams.video if not s.disposition & Disposition.attached_pic)
    stream = next(moving, None)
    if stream is None or container.format.name in _NOT_VIDEO:
        kind = "only sound" if container.streams.audio else f"no pictures; {given.advice}"
        container.close()
        raise SourceError(f"{given.name}: has no video stream ({kind})")
    # PyAV gives no context where FFmpeg lacks the decoder, and crashes when asked to decode.
    if stream.codec_context is None:
        container.close()
        raise SourceError(f"{given.name}: FFmpeg has no decoder for its video; convert it to H.264")
    return stream


def _frame_rate(stream: VideoStream, *, is_recording: bool) -> Fraction:
    """Nominal rate; the average one of a recording whose frames come at another pace."""
    nominal, average = stream.guessed_rate, stream.average_rate
    if is_recording and nominal and average and abs(nominal / average - 1) > _RATE_TOLERANCE:
        return average
    return nominal or average or _DEFAULT_FPS


def _announced_length(container: InputContainer, stream: VideoStream, fps: Fraction) -> int | None:
    if stream.frames:
        return stream.frames
    return round(container.duration / av.time_base * fps) if container.duration else None


def _pictures(
    given: Input,
    container: InputContainer,
    stream: VideoStream,
    ending: Ending,
    length: int | None,
) -> Pictures:
    """Pictures of a stream to its end; `StreamError` after the last one if that came too early."""
    count = 0
    fault = None
    with container:
        try:
            for picture in decoded(container, stream, ending):
                yield picture
                count += 1
        except (av.FFmpegError, OSError, ValueError) as error:
            fault = _reason(error)
    given.check_interrupted()
    fault = fault or ending.fault()
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
        return "nothing came before the time ran out"
    text = getattr(error, "strerror", None) or str(error)
    return " ".join(text.split())
