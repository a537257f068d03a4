"""Frames out of anything FFmpeg can open, through PyAV."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice
from typing import Any

import av
from av.codec.context import ThreadType
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from ssiam.errors import SourceError, SsiamError, StreamError
from ssiam.video.decoding import Decoding
from ssiam.video.ending import Ending
from ssiam.video.frames import DeepPictures, Source, SourceFacts
from ssiam.video.levels import LEVEL_FRAMES, Levels, eight_bit
from ssiam.video.pipes import Pipe
from ssiam.video.rates import DEFAULT_FPS, Times, frame_rate, measured_rate, origin_of_times
from ssiam.video.sound import Sound

# Decoder threads for recordings: the next frame is decoded while this one is tracked. Each
# holds one more frame in memory and delays by one, so live streams get a single one.
_RECORDING_THREADS = 2
# Formats that announce no end: only the damage marks of their frames tell that they were cut,
# and decoder threads lose those marks.
_BROADCAST = ("mpegts", "mpeg")
# FFmpeg's demuxer of text art takes any .txt for a video.
_NOT_VIDEO = ("tty",)
# Pictures that show others: covers of music, the thumbnails of a chapter list.
_NOT_MOVING = Disposition.attached_pic | Disposition.timed_thumbnails
# Frames over which a rate is measured that the container does not tell.
_MEASURED_FRAMES = 6
# A title in an unknown encoding must not make a file unreadable; PyAV 19 sees to it by itself.
_METADATA: dict[str, Any] = (
    {"metadata_errors": "replace"} if int(av.__version__.split(".")[0]) < 19 else {}
)


@dataclass(frozen=True)
class Input:
    """What PyAV is to open: `file` a URL or what has a `read`, `name` how messages call it.

    Attributes
    ----------
    stream : int or None
        Which of the video streams, from 0, covers not counted; None for the largest.
    levels : Levels or None
        For values of more than 8 bits; None takes them from the first frames.
    sound : bool
        Whether to keep the sound beside the frames (`SourceFacts.sound`).
    is_remote : bool
        It comes over a network, at the pace of who sends it.
    """

    name: str
    file: Any
    format: str | None = None
    options: dict[str, str] = field(default_factory=dict)
    timeout: tuple[float, float] | None = None
    advice: str = "is it a video, and is it whole?"
    stream: int | None = None
    levels: Levels | None = None
    sound: bool = False
    is_remote: bool = False

    @property
    def pipe(self) -> Pipe | None:
        """The file if it is a pipe."""
        return self.file if isinstance(self.file, Pipe) else None

    def check_interrupted(self) -> None:
        """Raise `KeyboardInterrupt` if one came while FFmpeg read from a pipe."""
        if self.pipe is not None:
            self.pipe.check()


def open_container(given: Input) -> Source:
    """`Source` of a video stream; `SourceError` if there is none that can be decoded."""
    container = _open(given)
    stream = _video_stream(given, container)
    is_recording = bool(container.duration)
    rate = frame_rate(stream, is_recording=is_recording)
    fps = rate.fps or DEFAULT_FPS
    if is_recording and container.format.name not in _BROADCAST:
        stream.thread_type = ThreadType.FRAME
        stream.thread_count = _RECORDING_THREADS
    else:
        stream.thread_count = 1
    length = _announced_length(container, stream, fps)
    times = origin_of_times(container, is_remote=given.is_remote)
    facts = _facts(given, container, stream, times)
    facts.is_variable = facts.is_variable or rate.is_variable
    ending = Ending(container, stream, fps, pipe=given.pipe)
    decoding = Decoding(container, stream, ending, facts, times)
    pictures = _pictures(given, decoding, length)
    if rate.fps is None:
        first, pictures = _peeked(pictures)
        fps = measured_rate(first) or fps
    shown = eight_bit(
        given.name, pictures, facts, given.levels, LEVEL_FRAMES if is_recording else 1
    )
    return Source(given.name, shown, fps=fps, length=length, facts=facts)


def _facts(
    given: Input, container: InputContainer, stream: VideoStream, times: Times
) -> SourceFacts:
    facts = SourceFacts()
    if given.sound and container.streams.audio:
        facts.sound = Sound(container.streams.audio)
    if times is Times.STREAM:
        return facts
    facts.is_variable = times is Times.ARRIVAL
    facts.is_rate_known = times is Times.UNKNOWN and bool(stream.codec_context.framerate)
    facts.remarks.append(
        "tells no times: those of arrival are taken"
        if times is Times.ARRIVAL
        else f"tells no times: taken as {float(stream.guessed_rate or DEFAULT_FPS):g} a second"
    )
    return facts


def _peeked(pictures: DeepPictures) -> tuple[list[float | None], DeepPictures]:
    """The times of the first pictures, and all pictures."""
    held: list[Any] = []
    error: SsiamError | None = None
    try:
        held.extend(islice(pictures, _MEASURED_FRAMES))
    except SsiamError as raised:
        error = raised

    def replayed() -> DeepPictures:
        with closing(pictures):
            while held:
                yield held.pop(0)
            if error is not None:
                raise error
            yield from pictures

    return [time for time, _ in held], replayed()


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
    """The stream that was asked for, else the one with the most pixels that can be decoded."""
    moving = [s for s in container.streams.video if not s.disposition & _NOT_MOVING]
    if not moving or container.format.name in _NOT_VIDEO:
        kind = "only sound" if container.streams.audio else f"no pictures; {given.advice}"
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


def _pictures(given: Input, decoding: Decoding, length: int | None) -> DeepPictures:
    """Pictures of a stream to its end; `StreamError` after the last one if that came too early."""
    count = 0
    fault = None
    with decoding.container, closing(decoding.pictures()) as pictures:
        try:
            for picture in pictures:
                yield picture
                count += 1
        except (av.FFmpegError, OSError, ValueError) as error:
            fault = _reason(error)
    given.check_interrupted()
    fault = fault or decoding.ending.fault()
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
