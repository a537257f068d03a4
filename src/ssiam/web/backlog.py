"""`Backlog`: steps on their way to a disk that may be slow."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Final

from ssiam.video import Frame
from ssiam.web.step import Step

_WAITING: Final = 60  # steps that may wait; more are left out


class Backlog:
    """Steps from a session's thread to another one, which iterates; each frame once.

    A frame is told of twice while its source is paused.
    """

    def __init__(self) -> None:
        self._steps: SimpleQueue[Step | None] = SimpleQueue()
        self._taken: Frame | None = None

    def add(self, step: Step) -> bool:
        """Take in a step, at once; False if it had to be left out."""
        if self._taken is step.frame:
            return True
        self._taken = step.frame
        if self._steps.qsize() >= _WAITING:
            return False
        self._steps.put(step)
        return True

    def end(self) -> None:
        """Nothing comes any more; what is there is still taken."""
        self._steps.put(None)

    def clear(self) -> None:
        """Let go of the steps that wait: nobody takes them any more."""
        self._taken = None
        with suppress(Empty):
            while True:
                self._steps.get_nowait()

    def __iter__(self) -> Iterator[Step]:
        return iter(self._steps.get, None)
