"""`Sound`: the audio packets of a source, and copying them into a written video."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from typing import Any

import av
from av.audio.stream import AudioStream
from av.container import OutputContainer
from av.packet import Packet
from av.stream import Stream

_log = logging.getLogger(__name__)

# Seconds by which a frame's time may be rounded before the sound is shifted with it.
_SLACK = 0.02
# Codecs that FFmpeg accepts for a container although their times are lost in it.
_UNFIT = {"avi": ("vorbis", "opus")}


class Sound:
    """Queue of the audio packets of a container.

    Attributes
    ----------
    streams : tuple of AudioStream
    origin : Fraction or None
        Time of the first video frame, seconds by the clock of the container; None until it is
        known, or if it has no time.
    """

    def __init__(self, streams: Sequence[AudioStream]) -> None:
        self.streams = tuple(streams)
        self.origin: Fraction | None = None
        self._packets: deque[Packet[Stream]] = deque()
        self._indexes = {stream.index for stream in streams}

    def add_packet(self, packet: Packet[Stream]) -> None:
        """Keep a packet if it belongs to one of the audio streams."""
        if packet.stream.index in self._indexes and packet.size and not packet.is_corrupt:
            self._packets.append(packet)

    def discard(self) -> None:
        """Drop all packets and keep none from now on."""
        self._indexes = set()
        self._packets.clear()

    def skip_until(self, seconds: float) -> None:
        """Drop the packets that start before `seconds` since the first video frame."""
        while self.next_before(seconds) is not None:
            pass

    def next_before(self, seconds: float) -> tuple[Packet[Stream], Fraction] | None:
        """The next packet that starts before `seconds`, and its time; None if there is none.

        Times are in seconds since the first video frame.
        """
        while self._packets and self.origin is not None:
            packet = self._packets[0]
            if packet.pts is None or packet.dts is None or packet.time_base is None:
                self._packets.popleft()
                continue
            time = packet.pts * packet.time_base - self.origin
            if time >= seconds:
                return None
            self._packets.popleft()
            return packet, time
        return None


def _codec(stream: AudioStream) -> str:
    """Name of the codec; PyAV has no context for what FFmpeg cannot decode."""
    return "unknown" if stream.codec_context is None else stream.codec_context.codec.canonical_name


class SoundCopy:
    """Copies audio packets into the container of a written video.

    Parameters
    ----------
    container : OutputContainer
        Receives the audio streams; its header must not be written yet.
    sound : Sound
    """

    def __init__(self, container: OutputContainer, sound: Sound) -> None:
        self._container, self._sound = container, sound
        self._refused: list[str] = []
        self._written: dict[int, AudioStream] = {}
        self._last_dts: dict[int, int] = {}
        self._shift = 0.0
        for stream in sound.streams:
            self._add(stream)

    def _add(self, stream: AudioStream) -> None:
        name = _codec(stream)
        is_known = name in self._container.supported_codecs
        if is_known and name not in _UNFIT.get(self._container.format.name, ()):
            with suppress(av.FFmpegError, ValueError):
                self._written[stream.index] = self._container.add_stream_from_template(stream)
                return
        self._refused.append(name)

    def omitted(self, suffix: str, *, header_failed: bool = False) -> str | None:
        """Why sound is omitted from a file with this suffix; None if all of it is copied.

        `header_failed` is True if the container accepted the streams but could not write its
        header with them.
        """
        all_codecs = [_codec(stream) for stream in self._sound.streams]
        refused = all_codecs if header_failed else self._refused
        if not refused:
            return None
        advice = "" if suffix.lower() == ".mkv" else "; .mkv holds most kinds"
        return f"{suffix} cannot hold {', '.join(dict.fromkeys(refused))} as it is{advice}"

    def follow(self, source_time: float, written_time: float) -> None:
        """Write the sound up to a frame, given its time (s) in the source and in the file."""
        if abs(written_time - source_time - self._shift) > _SLACK:
            self._shift = written_time - source_time
        self.write_until(written_time)

    def write_until(self, seconds: float) -> None:
        """Write the sound that starts before `seconds` in the file."""
        while (found := self._sound.next_before(seconds - self._shift)) is not None:
            self._write(*found)

    def _write(self, packet: Packet[Stream], time: Fraction) -> None:
        stream = self._written.get(packet.stream.index)
        base: Any = packet.time_base
        if stream is None or packet.pts is None or packet.dts is None:
            return
        pts = round((time + Fraction(self._shift)) / base)
        dts = pts + packet.dts - packet.pts
        index = packet.stream.index
        if dts < 0 or dts <= self._last_dts.get(index, -1):
            return
        self._last_dts[index] = dts
        packet.pts, packet.dts, packet.stream = pts, dts, stream
        try:
            self._container.mux_one(packet)
        except (av.error.InvalidDataError, av.error.ArgumentError) as error:
            # Damaged sound does not end the video.
            _log.debug("skipped an audio packet that cannot be copied: %s", error.strerror)
