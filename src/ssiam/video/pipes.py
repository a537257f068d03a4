"""`Pipe`: standard input as FFmpeg reads it."""

from __future__ import annotations

from io import BufferedReader


class Pipe:
    """A stream of bytes that cannot be wound back; `count` is how many have been read.

    A Python object, because FFmpeg's own pipe would not wake up for Ctrl-C. PyAV drops what is
    raised in `read`, so that Ctrl-C ends the data there, and `check` raises it afterwards.
    """

    def __init__(self, file: BufferedReader) -> None:
        self._file = file
        self._interrupted = False
        self.count = 0

    def read(self, size: int) -> bytes:
        """What has arrived, `size` bytes at most; empty at the end."""
        try:
            # Not `read`, which would wait for all `size` bytes of a slow stream.
            data = self._file.read1(size)
        except KeyboardInterrupt:
            self._interrupted = True
            return b""
        self.count += len(data)
        return data

    def check(self) -> None:
        """Raise `KeyboardInterrupt` if one came while waiting for data."""
        if self._interrupted:
            raise KeyboardInterrupt
