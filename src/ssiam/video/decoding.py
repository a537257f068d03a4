"""Pictures out of an opened container: packets, frames, times, and the right way up."""

from __future__ import annotations

import logging
from collections.abc import Generator
from contextlib import closing, suppress
from dataclasses import dataclass
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

from ssiam.video.arrivals import arriving
from ssiam.video.ending import Ending
from ssiam.video.frames import DeepPictures, SourceFacts
from ssiam.video.orientation import Orientation, Orientations
from ssiam.video.rates import DEFAULT_FPS, Times

_log = logging.getLogger(__name__)

# A packet, and the second by this machine's clock at which it came, where that is of use.
Arrived: TypeAlias = "tuple[Packet[Stream], float]"

# Containers that hold decoding times only. What FFmpeg makes of them for presentation is out of
# order with B-frames, and late by a frame without; frames come out of decoders at them.
_DECODING_TIMES = ("avi", "asf")
# Layouts of gray that are taken over in their own depth; others of more than 8 bits as 16.
_DEEP_GRAY = ("gray9", "gray10", "gray12", "gray14", "gray16", "grayf32")


@dataclass(frozen=True)
class Decoding:
    """A stream of an opened container, and who is told what comes out of it."""

    container: InputContainer
    stream: VideoStream
    ending: Ending
    facts: SourceFacts
    times: Times = Times.STREAM

    def pictures(self) -> DeepPictures:
        """Every picture of the stream with its seconds since the first."""
        origin: Fraction | None = None
        last: Fraction | None = None
        started: float | None = None
        orientations = Orientations()
        with closing(_packets(self)) as packets:
            for packet, arrived in packets:
                for frame in self._frames(packet):
                    self.ending.note_frame(frame)
                    last, orientation = self._seconds(frame, last), orientations.of(frame)
                    if started is None:
                        started, origin = arrived, last
                        self._note_first(orientation, origin)
                    image = orientation.applied(_values(frame))
                    yield self._time(last, origin, arrived - started), image

    def _frames(self, packet: Packet[Stream]) -> list[VideoFrame]:
        """Frames that a packet completes; none for a damaged one, after which decoders recover."""
        try:
            return [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
        except av.FFmpegError as error:
            self.facts.undecoded += 1
            _log.debug("skipped a packet that cannot be decoded: %s", error.strerror)
            return []

    def _note_first(self, orientation: Orientation, origin: Fraction | None) -> None:
        aspect = self.stream.sample_aspect_ratio or Fraction(1)
        if aspect > 0:
            self.facts.pixel_aspect = 1 / aspect if orientation.is_transposed else aspect
        if self.facts.sound is not None:
            self.facts.sound.origin = origin

    def _time(
        self, seconds: Fraction | None, origin: Fraction | None, arrived: float
    ) -> float | None:
        if self.times is Times.STREAM:
            return None if seconds is None or origin is None else float(seconds - origin)
        return arrived if self.times is Times.ARRIVAL else None

    def _seconds(self, frame: VideoFrame, last: Fraction | None) -> Fraction | None:
        """Time of a frame, after one at `last`, by the clock of the container."""
        if self.container.format.name not in _DECODING_TIMES:
            ticks = frame.pts
        elif frame.dts is None and last is not None:
            # The last frames, which the decoder gives out when no more packets come.
            return last + 1 / (self.stream.guessed_rate or DEFAULT_FPS)
        else:
            ticks = frame.dts
        return None if ticks is None or frame.time_base is None else ticks * frame.time_base


def _packets(decoding: Decoding) -> Generator[Arrived, None, None]:
    """Packets of the stream and when they arrived, without a cut one at the very end.

    A decoder with threads that meets an error while it is emptied drops the good frames it holds.
    """
    damaged: Arrived | None = None
    sound = decoding.facts.sound
    # After the last packet PyAV stumbles over streams that turned up in the middle of the file.
    with suppress(IndexError), closing(_demuxed(decoding)) as demuxed:
        for packet, arrived in demuxed:
            decoding.ending.note_packet(packet)
            if sound is not None:
                sound.note(packet)
            if packet.stream.index != decoding.stream.index:
                continue
            if damaged is not None and packet.size:
                yield damaged
            damaged = (packet, arrived) if packet.is_corrupt else None
            if damaged is None:
                yield packet, arrived


def _demuxed(decoding: Decoding) -> Generator[Arrived, None, None]:
    packets = decoding.container.demux()
    if decoding.times is Times.ARRIVAL:
        yield from arriving(packets)
    else:
        yield from ((packet, 0.0) for packet in packets)


def _values(frame: VideoFrame) -> NDArray[Any]:
    """(H, W, 3) BGR; of gray and RGB of more than 8 bits the values themselves, gray as (H, W)."""
    layout = frame.format
    is_gray = layout.name.startswith(("gray", "ya"))
    if not (is_gray or layout.is_rgb) or max(c.bits for c in layout.components) <= 8:
        return np.asarray(frame.to_ndarray(format="bgr24"))
    if not is_gray:
        return np.asarray(frame.to_ndarray(format="bgr48le"))
    is_known = layout.name.removesuffix("le").removesuffix("be") in _DEEP_GRAY
    return np.asarray(frame.to_ndarray(format=None if is_known else "gray16le"))
