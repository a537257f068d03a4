"""`Pipe`: standard input as FFmpeg reads it."""

from __future__ import annotations

from io import BufferedReader


class Pipe:
    """A stream of bytes that cannot be wound back; `count` is how many have been read.

    A Python object and not FFmpeg's own pipe, so that Ctrl-C is seen while waiting for data.
    """

    def __init__(self, file: BufferedReader) -> None:
        self._file = file
        self.count = 0

    def read(self, size: int) -> bytes:
        """What has arrived, `size` bytes at most; empty at the end."""
        # Not `read`, which would wait for all `size` bytes of a slow stream.
        data = self._file.read1(size)
        self.count += len(data)
        return data
