"""Delivery of a live session's steps and messages: `Listeners` and `StepQueue`."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Final, Generic, TypeVar

from ssiam.video import Frame
from ssiam.web.types import Step

_log = logging.getLogger(__name__)

_MAX_WAITING: Final = 60  # steps in a `StepQueue`; more are dropped

Event = TypeVar("Event")


class Listeners(Generic[Event]):
    """Callbacks for one kind of event.

    Listeners can be added and removed on any thread. Each is called on the thread that notifies.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listeners: tuple[Callable[[Event], object], ...] = ()

    def add(self, listener: Callable[[Event], object]) -> Callable[[], None]:
        """Call `listener` with every event from now on.

        Returns
        -------
        callable
            Removes the listener.
        """
        with self._lock:
            self._listeners = (*self._listeners, listener)

        def remove() -> None:
            with self._lock:
                others = (each for each in self._listeners if each is not listener)
                self._listeners = tuple(others)

        return remove

    def notify(self, event: Event) -> None:
        """Call all listeners in order. An exception in one is logged; the others are called."""
        for listener in self._listeners:
            try:
                listener(event)
            except Exception:
                _log.exception("a listener failed")


class StepQueue:
    """A bounded queue of steps from the session's thread to a thread that writes to disk.

    The consumer iterates over it. Each frame is queued once: steps that repeat the last frame, for
    example after a command while paused, are ignored.
    """

    def __init__(self) -> None:
        self._steps: SimpleQueue[Step | None] = SimpleQueue()
        self._last_frame: Frame | None = None

    def put(self, step: Step) -> bool:
        """Queue a step without blocking; False if it was dropped because the queue is full."""
        if self._last_frame is step.frame:
            return True
        self._last_frame = step.frame
        if self._steps.qsize() >= _MAX_WAITING:
            return False
        self._steps.put(step)
        return True

    def close(self) -> None:
        """End the iteration after the steps that are queued."""
        self._steps.put(None)

    def clear(self) -> None:
        """Discard the queued steps."""
        self._last_frame = None
        with suppress(Empty):
            while True:
                self._steps.get_nowait()

    def __iter__(self) -> Iterator[Step]:
        return iter(self._steps.get, None)
