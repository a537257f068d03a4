"""`open_pipe`: standard input, read so that waiting for more of it can be ended."""

from __future__ import annotations

import io
import os
import select
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from ssiam.video import Source
from ssiam.video.containers import Input, Pipe, open_container
from ssiam.video.levels import Levels

if TYPE_CHECKING:
    from typing_extensions import Buffer

# Seconds between two looks at whether to go on waiting.
_LOOK = 0.2


class _Stoppable(io.RawIOBase):
    """Bytes of a pipe; none any more after `stop`.

    Not Python's own standard input: a thread that waits in it is fatal when the program ends.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._stopped = threading.Event()

    def stop(self) -> None:
        self._stopped.set()

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Buffer) -> int:
        view = memoryview(buffer)
        while not self._stopped.is_set():
            # Windows can only wait for sockets.
            if os.name == "nt" or select.select([self._descriptor], [], [], _LOOK)[0]:
                data = os.read(self._descriptor, len(view))
                view[: len(data)] = data
                return len(data)
        return 0


def is_piped() -> bool:
    """Whether standard input is a pipe, not a file or a keyboard."""
    return sys.stdin is not None and not sys.stdin.isatty() and not sys.stdin.buffer.seekable()


def open_pipe(
    stream: int | None = None, levels: tuple[float, float] | None = None
) -> tuple[Source, Callable[[], None]]:
    """`Source` of standard input, and what ends it while it waits, from any thread.

    `stream` and `levels` are those of `open_source`.

    Raises
    ------
    SourceError
        There is no video in it.
    """
    raw = _Stoppable(sys.stdin.fileno())
    given = Input(
        name="standard input",
        file=Pipe(io.BufferedReader(raw)),
        advice="pipe in y4m, mpegts or matroska",
        stream=stream,
        levels=None if levels is None else Levels(*levels),
    )
    return open_container(given), raw.stop
