"""`TruncationCheck`: whether a container was read to its end or breaks off before it.

FFmpeg reports most truncated files as an ordinary end of file. Four signs reveal them: the last
packet or the last frame is damaged; the packets stop short of what the header announces; the
bytes of an MPEG transport stream or of y4m do not end on a packet boundary.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from fractions import Fraction

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

# How far a complete file may stop short of its announced end. Where frames are counted: less than
# two frames, for rounding. Elsewhere 0.1 s, for clocks of 1 ms and padded audio (Matroska, FLV),
# or two frames, because packets there do not always carry the duration of the last frame.
_COUNTED_SLACK_FRAMES = 1.5
_SLACK_FRAMES = 2.0
_SLACK_SECONDS = 0.1
# Frames that a decoder may hold back for reordering (H.264 allows 16).
_REORDERED_FRAMES = 32
# Packet sizes of a transport stream, bytes: plain, with time code (Blu-ray), with parity (DVB).
_TS_PACKETS = (188, 192, 204)


class TruncationCheck:
    """Compares what a container announces with what is read from it.

    Pass it every packet of every stream and every decoded frame, then ask for the `fault`.

    Parameters
    ----------
    container : InputContainer
    stream : VideoStream
        The stream that is decoded.
    fps : Fraction
        Frames per second.
    bytes_read : callable, optional
        Number of bytes read so far, for input without a size; by default the container's size.
    """

    def __init__(
        self,
        container: InputContainer,
        stream: VideoStream,
        fps: Fraction,
        *,
        bytes_read: Callable[[], int] | None = None,
    ) -> None:
        self._format = container.format.name
        self._size = container.size
        self._bytes_read = bytes_read
        self._last_byte = 0
        self._announced_frames = stream.frames
        self._announced_end = _announced_seconds(container, stream)
        self._video_index = stream.index
        self._packets = 0
        self._last_dts: float | None = None
        self._longest_gap = float(1 / fps)
        self._reached = 0.0
        self._damaged_packet = False
        self._last_pts: int | None = None
        self._damaged_pts: deque[int | None] = deque(maxlen=_REORDERED_FRAMES)
        self._last_frame_damaged = False

    def add_packet(self, packet: Packet[Stream]) -> None:
        """Record a packet; call in file order."""
        if not packet.size:
            return
        self._damaged_packet = packet.is_corrupt
        is_video = packet.stream.index == self._video_index
        self._packets += is_video
        self._last_byte = (packet.pos or 0) + packet.size
        if packet.pts is None or packet.time_base is None:
            return
        if is_video:
            self._last_pts = packet.pts
            self._update_longest_gap(packet)
        if is_video or not self._announced_frames:
            end = float((packet.pts + (packet.duration or 0)) * packet.time_base)
            self._reached = max(self._reached, end)

    def add_frame(self, frame: VideoFrame) -> None:
        """Record a decoded frame."""
        self._last_frame_damaged = frame.is_corrupt
        if frame.is_corrupt:
            self._damaged_pts.append(frame.pts)

    def fault(self) -> str | None:
        """How the container stopped before its end, or None; call after the last packet."""
        # With reordering, the last packet may not contain the last frame that is displayed.
        last_is_cut = self._last_pts is not None and self._last_pts in self._damaged_pts
        if self._damaged_packet or self._last_frame_damaged or last_is_cut:
            return "its last frame is cut"
        if self._has_partial_packet():
            return "its last bytes are cut"
        return "it ends before its announced end" if self._ends_early() else None

    def _has_partial_packet(self) -> bool:
        """Whether bytes are left over, in formats that FFmpeg reads in whole packets."""
        size = self._size if self._bytes_read is None else self._bytes_read()
        if self._format == "mpegts":
            return size > 0 and all(size % packet for packet in _TS_PACKETS)
        return self._format == "yuv4mpegpipe" and size > self._last_byte

    def _ends_early(self) -> bool:
        # Files with dropped or trimmed frames announce more of them than they play.
        if self._packets >= self._announced_frames > 0 or self._announced_end is None:
            return False
        slack = max(_SLACK_SECONDS, _SLACK_FRAMES * self._longest_gap)
        if self._announced_frames:
            slack = _COUNTED_SLACK_FRAMES * self._longest_gap
        return self._reached < self._announced_end - slack

    def _update_longest_gap(self, packet: Packet[Stream]) -> None:
        """Track the longest time between frames, by decoding times, which never jump back."""
        if packet.dts is None or packet.time_base is None:
            return
        dts = float(packet.dts * packet.time_base)
        if self._last_dts is not None:
            self._longest_gap = max(self._longest_gap, dts - self._last_dts)
        self._last_dts = dts


def _announced_seconds(container: InputContainer, stream: VideoStream) -> float | None:
    """Announced end of the video, seconds; of the whole container if no frames are counted.

    If container and stream disagree, the shorter duration counts: an edit list shortens only one
    of them.
    """
    of_container = container.duration / av.time_base if container.duration else None
    if not stream.frames:
        return of_container
    if container.format.name == "avi" and stream.average_rate:
        # FFmpeg reduces the duration of a cut AVI by the missing bytes, but not the frame count.
        return float(stream.frames / stream.average_rate)
    of_stream = None
    if stream.duration and stream.time_base:
        of_stream = float(stream.duration * stream.time_base)
    return min((seconds for seconds in (of_container, of_stream) if seconds), default=None)
