"""`ReversedFrames`: the frames of a file from a later one to an earlier one."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ssiam.addresses import display_name, is_address
from ssiam.errors import SourceError, SsiamError
from ssiam.geometry import Image
from ssiam.video.containers import Position
from ssiam.video.frames import Frame, Source, SourceInfo
from ssiam.video.sources import RawFormat, open_file_at, open_source

_CHUNK_BYTES: Final = 192 << 20  # of the frames that are held at a time
_LEAST_CHUNK: Final = 4  # frames
# Seconds before a chunk from which decoding starts at the second attempt: key frames of broadcasts
# are closer than that, and frames beside a key frame may refer to those before it.
_MARGIN: Final = 10.0


@dataclass(frozen=True)
class FrameRecord:
    """What is known of a frame that was decoded before.

    Attributes
    ----------
    time : float or None
        Seconds since the first frame.
    checksum : int
        CRC-32 of its pixels.
    """

    time: float | None
    checksum: int

    @classmethod
    def of(cls, frame: Frame) -> FrameRecord:
        """The record of a frame."""
        return cls(frame.time, _checksum(frame.image))


class ReversedFrames:
    """Iterates over frames of a file or folder from the last to the first.

    The frames are decoded forward in chunks of limited size, the last chunk first. Each chunk is
    decoded from the key frame before it, and its frames are compared with their records; if they
    differ, as with streams that cannot be positioned exactly, it is decoded from the start of the
    file.

    Threads: one thread at a time.

    Parameters
    ----------
    spec : str
        A file or a folder, as for `open_source`.
    records : sequence of FrameRecord
        Of each frame of the iteration, in the order of the source.
    first : int
        Index of the first of these frames in the source, which is the last of the iteration.
    info : SourceInfo
        Of the source when the records were made.
    raw, stream, levels
        As for `open_source`.
    chunk_bytes : int
        Memory for the frames of a chunk.
    """

    def __init__(
        self,
        spec: str,
        records: Sequence[FrameRecord],
        first: int,
        info: SourceInfo,
        *,
        raw: RawFormat | None = None,
        stream: int | None = None,
        levels: tuple[float, float] | None = None,
        chunk_bytes: int = _CHUNK_BYTES,
    ) -> None:
        self._spec = spec
        self._records = records
        self._first = first
        self._origin = info.origin
        self._raw, self._stream = raw, stream
        self._levels = levels or info.levels
        self._chunk_bytes = chunk_bytes

    def __iter__(self) -> Iterator[Frame]:
        stop = self._first + len(self._records)
        length = 1
        while stop > self._first:
            start = max(self._first, stop - length)
            images = self._chunk(start, stop)
            # A chunk of one frame, the first, shows how large the frames are.
            length = max(_LEAST_CHUNK, self._chunk_bytes // images[0].nbytes)
            for index in reversed(range(start, stop)):
                yield Frame(index, self._record(index).time, images.pop())
            stop = start

    def _chunk(self, start: int, stop: int) -> list[Image]:
        """The images of the frames from `start` to before `stop`."""
        time = self._record(start).time
        if self._origin is not None and time is not None and Path(self._spec).is_file():
            for seconds in (time, max(0.0, time - _MARGIN)):
                found = self._from_key_frame(start, stop, Position(seconds, self._origin))
                if found is not None:
                    return found
        return self._from_beginning(start, stop)

    def _from_key_frame(self, start: int, stop: int, position: Position) -> list[Image] | None:
        """The images, decoded from the key frame at `position`; None if they are others."""
        expected = {self._record(index).time: index for index in range(start, stop)}
        images: dict[int, Image] = {}
        with (
            suppress(SsiamError),
            open_file_at(
                self._spec, position, raw=self._raw, stream=self._stream, levels=self._levels
            ) as frames,
        ):
            for frame in frames:
                index = expected.get(frame.time)
                if index is not None:
                    images[index] = frame.image
                if index == stop - 1:
                    break
        chunk = range(start, stop)
        if any(
            index not in images or _checksum(images[index]) != self._record(index).checksum
            for index in chunk
        ):
            return None
        return [images[index] for index in chunk]

    def _record(self, index: int) -> FrameRecord:
        return self._records[index - self._first]

    def _from_beginning(self, start: int, stop: int) -> list[Image]:
        images = []
        with self._open() as frames:
            for frame in frames:
                if frame.index >= start:
                    images.append(frame.image)
                if frame.index == stop - 1:
                    break
        if len(images) < stop - start:
            raise SourceError(
                f"{self._spec}: has fewer frames than before; does another program change it?"
            )
        return images

    def _open(self) -> Source:
        return open_source(self._spec, raw=self._raw, stream=self._stream, levels=self._levels)


def is_reversible(spec: str) -> bool:
    """Whether the source is a file or folder, which can be read repeatedly."""
    path = Path(spec)
    return bool(spec) and not is_address(spec) and (path.is_file() or path.is_dir())


def check_reversible(spec: str) -> None:
    """Raise `SourceError` unless the source can be read repeatedly."""
    if not is_reversible(spec):
        raise SourceError(
            f"{display_name(spec)}: cannot be read from its end: save it to a file, and give that"
        )


def _checksum(image: Image) -> int:
    return zlib.crc32(image.data if image.flags.c_contiguous else image.tobytes())
