"""Decoded images of an opened container: packets, frames, timestamps and orientation."""

from __future__ import annotations

import logging
import queue
import struct
import threading
import time
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Any, TypeAlias

import av
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream
from av.video.frame import VideoFrame
from av.video.stream import VideoStream
from numpy.typing import NDArray

from ssiam.video.frames import DecodedImages, SourceInfo
from ssiam.video.truncation import TruncationCheck

_log = logging.getLogger(__name__)

# Frames per second that FFmpeg assumes if a format has no rate.
DEFAULT_FPS = Fraction(25)

# Containers that hold decoding times only. The presentation times that FFmpeg derives from them
# are out of order with B-frames and late by one frame without; decoders emit frames at the
# decoding times.
_DECODING_TIMES = ("avi", "asf")
# Gray pixel formats that keep their own depth; others of more than 8 bits become 16 bits.
_DEEP_GRAY = ("gray9", "gray10", "gray12", "gray14", "gray16", "grayf32")
# FFmpeg's display matrix: nine 32-bit integers, of which the first two of the first two rows
# hold a, b, c, d of x' = a x + c y, y' = b x + d y.
_MATRIX = struct.Struct("=9i")
# Packets that may wait, one frame each. A slower consumer slows the sender down.
_QUEUE_SIZE = 64
# Seconds between two checks for whether the consumer has stopped.
_POLL = 0.2

# A packet and its time of arrival (`time.monotonic`, seconds); 0 where the time is not used.
_Arrived: TypeAlias = "tuple[Packet[Stream], float]"


class TimeSource(Enum):
    """Where the times of frames come from."""

    STREAM = "timestamps of the stream"
    ARRIVAL = "the clock of this machine"
    NONE = "unknown"


@dataclass(frozen=True)
class Decoder:
    """Decodes one video stream of an opened container.

    Attributes
    ----------
    container : InputContainer
    stream : VideoStream
    truncation : TruncationCheck
        Receives every packet and every decoded frame.
    info : SourceInfo
        Receives the pixel aspect, the sound and the number of skipped frames.
    time_source : TimeSource
        Where the times of the frames come from.
    origin : Fraction or None
        Time from which the times count, by the clock of the container, if decoding does not start
        at the first frame.
    """

    container: InputContainer
    stream: VideoStream
    truncation: TruncationCheck
    info: SourceInfo
    time_source: TimeSource = TimeSource.STREAM
    origin: Fraction | None = None

    def images(self) -> DecodedImages:
        """All images of the stream, each with its time in seconds since the first."""
        origin: Fraction | None = None
        last: Fraction | None = None
        started: float | None = None
        orientations = _OrientationReader()
        with closing(_packets(self)) as packets:
            for packet, arrived in packets:
                for frame in self._frames(packet):
                    self.truncation.add_frame(frame)
                    last, orientation = self._seconds(frame, last), orientations.read(frame)
                    if started is None:
                        started, origin = arrived, last if self.origin is None else self.origin
                        self._note_first(orientation, origin)
                    image = orientation.apply(_pixels(frame))
                    yield self._time(last, origin, arrived - started), image

    def _frames(self, packet: Packet[Stream]) -> list[VideoFrame]:
        """Frames completed by a packet; none for a damaged one, after which decoders recover."""
        try:
            return [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
        except av.FFmpegError as error:
            self.info.undecoded += 1
            _log.debug("skipped a packet that cannot be decoded: %s", error.strerror)
            return []

    def _note_first(self, orientation: _Orientation, origin: Fraction | None) -> None:
        aspect = self.stream.sample_aspect_ratio or Fraction(1)
        if aspect > 0:
            self.info.pixel_aspect = 1 / aspect if orientation.is_transposed else aspect
        self.info.origin = origin
        if self.info.sound is not None:
            self.info.sound.origin = origin

    def _time(
        self, seconds: Fraction | None, origin: Fraction | None, elapsed: float
    ) -> float | None:
        """Seconds since the first frame, from the timestamps or from the times of arrival."""
        if self.time_source is TimeSource.STREAM:
            return None if seconds is None or origin is None else float(seconds - origin)
        return elapsed if self.time_source is TimeSource.ARRIVAL else None

    def _seconds(self, frame: VideoFrame, last: Fraction | None) -> Fraction | None:
        """Time of a frame that follows one at `last`, by the clock of the container."""
        if self.container.format.name not in _DECODING_TIMES:
            ticks = frame.pts
        elif frame.dts is None and last is not None:
            # The last frames, which the decoder emits after the last packet.
            return last + 1 / (self.stream.guessed_rate or DEFAULT_FPS)
        else:
            ticks = frame.dts
        return None if ticks is None or frame.time_base is None else ticks * frame.time_base


def _packets(decoder: Decoder) -> Generator[_Arrived, None, None]:
    """Packets of the stream with their times of arrival, except a damaged one at the very end.

    A decoder with threads that meets an error while it is flushed drops the good frames it holds.
    """
    damaged: _Arrived | None = None
    sound = decoder.info.sound
    # After the last packet PyAV raises IndexError for streams that appeared mid-file.
    with suppress(IndexError), closing(_demuxed(decoder)) as demuxed:
        for packet, arrived in demuxed:
            decoder.truncation.add_packet(packet)
            if sound is not None:
                sound.add_packet(packet)
            if packet.stream.index != decoder.stream.index:
                continue
            if damaged is not None and packet.size:
                yield damaged
            damaged = (packet, arrived) if packet.is_corrupt else None
            if damaged is None:
                yield packet, arrived


def _demuxed(decoder: Decoder) -> Generator[_Arrived, None, None]:
    packets = decoder.container.demux()
    if decoder.time_source is TimeSource.ARRIVAL:
        yield from _with_arrival_times(packets)
    else:
        yield from ((packet, 0.0) for packet in packets)


def _with_arrival_times(packets: Iterable[Packet[Stream]]) -> Iterator[_Arrived]:
    """Each packet with its time of arrival, independent of how long each one is processed.

    A separate thread reads the packets. It ends with the iterator, which may take until the next
    packet arrives. Errors while reading are raised here, after the packets before them.
    """
    waiting: queue.Queue[_Arrived | Exception | None] = queue.Queue(_QUEUE_SIZE)
    closed = threading.Event()

    def put(item: _Arrived | Exception | None) -> None:
        while not closed.is_set():
            try:
                waiting.put(item, timeout=_POLL)
            except queue.Full:
                continue
            return

    def read() -> None:
        end: Exception | None = None
        try:
            for packet in packets:
                put((packet, time.monotonic()))
                if closed.is_set():
                    return
        except Exception as error:
            end = error
        put(end)

    reader = threading.Thread(target=read, name="ssiam-arrivals", daemon=True)
    reader.start()
    try:
        while (item := waiting.get()) is not None:
            if isinstance(item, Exception):
                raise item
            yield item
    finally:
        closed.set()
        reader.join()


def _pixels(frame: VideoFrame) -> NDArray[Any]:
    """(H, W, 3) uint8 BGR; gray and RGB of more than 8 bits keep their depth, gray as (H, W)."""
    layout = frame.format
    is_gray = layout.name.startswith(("gray", "ya"))
    if not (is_gray or layout.is_rgb) or max(c.bits for c in layout.components) <= 8:
        return np.asarray(frame.to_ndarray(format="bgr24"))
    if not is_gray:
        return np.asarray(frame.to_ndarray(format="bgr48le"))
    is_known = layout.name.removesuffix("le").removesuffix("be") in _DEEP_GRAY
    return np.asarray(frame.to_ndarray(format=None if is_known else "gray16le"))


@dataclass(frozen=True)
class _Orientation:
    """One of the eight upright orientations: transposed first, then mirrored."""

    is_transposed: bool = False
    is_mirrored_x: bool = False
    is_mirrored_y: bool = False

    def apply(self, image: NDArray[Any]) -> NDArray[Any]:
        """The (H, W) or (H, W, C) image turned upright; contiguous."""
        if self.is_transposed:
            image = image.swapaxes(0, 1)
        if self.is_mirrored_x:
            image = image[:, ::-1]
        if self.is_mirrored_y:
            image = image[::-1]
        return np.ascontiguousarray(image)


class _OrientationReader:
    """Reads the orientation of each frame, anew only when the frame's rotation changes.

    PyAV's side data and frame refer to each other: reading it for every frame would keep hundreds
    of frames in memory until Python collects reference cycles.
    """

    def __init__(self) -> None:
        self._rotation: int | None = None
        self._orientation = _Orientation()

    def read(self, frame: VideoFrame) -> _Orientation:
        """Orientation of the frame, rounded to the nearest quarter turn."""
        if frame.rotation != self._rotation:
            self._rotation, self._orientation = frame.rotation, _display_orientation(frame)
        return self._orientation


def _display_orientation(frame: VideoFrame) -> _Orientation:
    matrix: Any = frame.side_data.get("DISPLAYMATRIX")
    data = b"" if matrix is None else bytes(matrix)
    if len(data) < _MATRIX.size:
        return _Orientation()
    a, b, _, c, d, *_ = _MATRIX.unpack_from(data)
    if abs(a) + abs(d) >= abs(b) + abs(c):
        return _Orientation(False, a < 0, d < 0)
    return _Orientation(True, c < 0, b < 0)
