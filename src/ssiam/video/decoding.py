"""Pictures out of an opened container: packets, frames, times, and the right way up."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import suppress

import av
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ssiam.geometry import Image
from ssiam.video.ending import Ending
from ssiam.video.frames import Picture

_log = logging.getLogger(__name__)


def decoded(container: InputContainer, stream: VideoStream, ending: Ending) -> Iterator[Picture]:
    """Every picture of the stream with its seconds since the first; `ending` is told of all."""
    first_pts: int | None = None
    for packet in _packets(container, stream, ending):
        for frame in _frames(packet):
            ending.note_frame(frame)
            if first_pts is None:
                first_pts = frame.pts
            yield _seconds_since(first_pts, frame), _upright(frame)


def _packets(
    container: InputContainer, stream: VideoStream, ending: Ending
) -> Iterator[Packet[Stream]]:
    """Packets of the stream, without a cut one at the very end.

    A decoder with threads that meets an error while it is emptied drops the good frames it holds.
    """
    damaged: Packet[Stream] | None = None
    # After the last packet PyAV stumbles over streams that turned up in the middle of the file.
    with suppress(IndexError):
        for packet in container.demux():
            ending.note_packet(packet)
            if packet.stream.index != stream.index:
                continue
            if damaged is not None and packet.size:
                yield damaged
            damaged = packet if packet.is_corrupt else None
            if damaged is None:
                yield packet


def _frames(packet: Packet[Stream]) -> list[VideoFrame]:
    """Frames that a packet completes; none for a damaged one, after which the decoder recovers."""
    try:
        return [frame for frame in packet.decode() if isinstance(frame, VideoFrame)]
    except av.FFmpegError as error:
        _log.debug("skipped a packet that cannot be decoded: %s", error.strerror)
        return []


def _seconds_since(first_pts: int | None, frame: VideoFrame) -> float | None:
    if frame.pts is None or first_pts is None or frame.time_base is None:
        return None
    return float((frame.pts - first_pts) * frame.time_base)


def _upright(frame: VideoFrame) -> Image:
    image: Image = np.asarray(frame.to_ndarray(format="bgr24"), dtype=np.uint8)
    quarter_turns = round(frame.rotation / 90) % 4
    return np.ascontiguousarray(np.rot90(image, quarter_turns)) if quarter_turns else image
