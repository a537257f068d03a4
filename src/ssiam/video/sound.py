"""`Sound`: the sound of a source, kept beside its frames, and copied into a video."""

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

# Seconds by which frames may leave their own time, by rounding, before the sound follows them.
_SLACK = 0.02
# Sound that FFmpeg puts into a container without complaint, and whose times are lost in it.
_UNFIT = {"avi": ("vorbis", "opus")}


class Sound:
    """Packets of the sound streams of a container, until somebody takes them.

    Attributes
    ----------
    streams : tuple of AudioStream
    origin : Fraction or None
        Time of the first frame, seconds by the clock of the container; None as long as it, or its
        time, is unknown.
    """

    def __init__(self, streams: Sequence[AudioStream]) -> None:
        self.streams = tuple(streams)
        self.origin: Fraction | None = None
        self._packets: deque[Packet[Stream]] = deque()
        self._indexes = {stream.index for stream in streams}

    def note(self, packet: Packet[Stream]) -> None:
        """Keep a packet, if it is one of sound."""
        if packet.stream.index in self._indexes and packet.size and not packet.is_corrupt:
            self._packets.append(packet)

    def drop(self) -> None:
        """Keep nothing from now on."""
        self._indexes = set()
        self._packets.clear()

    def next_before(self, seconds: float) -> tuple[Packet[Stream], Fraction] | None:
        """The next packet that begins before `seconds` since the first frame, and its time."""
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
    """Its name; PyAV has no context for what FFmpeg cannot decode."""
    return "unknown" if stream.codec_context is None else stream.codec_context.codec.canonical_name


class SoundCopy:
    """Copies sound into a container beside the video that is written.

    Parameters
    ----------
    container : OutputContainer
        The streams are added to it; it must not have been begun.
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

    def silence(self, suffix: str, *, begun: bool = True) -> str | None:
        """Why sound is left out of a file with this suffix, None if all of it is in it.

        `begun` is False if the container took the streams but could not begin with them.
        """
        refused = self._refused if begun else [_codec(stream) for stream in self._sound.streams]
        if not refused:
            return None
        advice = "" if suffix.lower() == ".mkv" else "; .mkv holds most kinds"
        return f"{suffix} cannot hold {', '.join(dict.fromkeys(refused))} as it is{advice}"

    def follow(self, source_time: float, written_time: float) -> None:
        """Write the sound up to a frame, which is at these seconds in the source and the file."""
        if abs(written_time - source_time - self._shift) > _SLACK:
            self._shift = written_time - source_time
        self.write_until(written_time)

    def write_until(self, seconds: float) -> None:
        """Write the sound that begins before `seconds` in the file."""
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
            # Damaged sound is no reason to end the video.
            _log.debug("skipped a packet of sound that cannot be copied: %s", error.strerror)
