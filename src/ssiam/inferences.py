"""Work in another thread that begins with an inference.

Two threads of Python take turns at the interpreter, and on a busy machine each turn can take
milliseconds. An inference does not need it: what is started just before one never makes it wait.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class _Waiting(threading.local):
    start: Callable[[], None] | None = None


_WAITING = _Waiting()


@contextmanager
def started_by_inference(start: Callable[[], None]) -> Iterator[None]:
    """Call `start` with the first inference of this thread within the block, or after the block."""
    _WAITING.start = start
    try:
        yield
    finally:
        inference_begins()


def inference_begins() -> None:
    """Start what waits for an inference of this thread; networks call it just before they run."""
    start, _WAITING.start = _WAITING.start, None
    if start is not None:
        start()
