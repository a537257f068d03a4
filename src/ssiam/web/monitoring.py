"""Errors and stalls that a live session survives: `ErrorReporter` and `Watchdog`."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from ssiam.errors import SsiamError, one_line
from ssiam.web.types import Note

_log = logging.getLogger(__name__)

_REPEAT_AFTER: Final = 10.0  # seconds between two notes of the same error
_MAX_REMEMBERED: Final = 100  # different errors; beyond it, all are forgotten
_CHECKS_PER_LIMIT: Final = 5  # checks of the watchdog within its time limit


class ErrorReporter:
    """Reports each error once; the same error again after a pause, with a count.

    Parameters
    ----------
    notify : callable
        Receives the notes. Errors are logged as well.
    clock : callable
        Seconds.
    """

    def __init__(
        self, notify: Callable[[Note], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._notify, self._clock = notify, clock
        self._reported_at: dict[str, float] = {}  # message -> time of the last report
        self._unreported: dict[str, int] = {}  # message -> occurrences since then

    def report(self, context: str, error: Exception) -> str:
        """Report an error that occurred in `context`; return the error as one line."""
        text = one_line(error)
        message = f"{context}: {text}"
        now = self._clock()
        if now - self._reported_at.get(message, -_REPEAT_AFTER) < _REPEAT_AFTER:
            self._unreported[message] = self._unreported.get(message, 0) + 1
            return text
        if len(self._reported_at) >= _MAX_REMEMBERED:
            self._reported_at.clear()
            self._unreported.clear()
        self._reported_at[message] = now
        count = self._unreported.pop(message, 0)
        repeats = f" (and {count} more times since the last report)" if count else ""
        if isinstance(error, SsiamError):
            _log.info("%s", message)
        else:
            _log.error("%s", message, exc_info=error)
        self._notify(Note("error", message + repeats))
        return text


class Watchdog:
    """Detects tasks of one thread that exceed a time limit, from a separate thread.

    Parameters
    ----------
    limit : float
        Seconds that a task may take.
    stalled : callable
        Called on the watchdog's thread with the name of a task that exceeds the limit, once per
        task. Must not wait for the thread that runs the task.
    recovered : callable
        Called on the thread of the task when such a task finishes, with its name and its duration
        in seconds.
    """

    def __init__(
        self,
        limit: float,
        stalled: Callable[[str], None],
        recovered: Callable[[str, float], None],
    ) -> None:
        self._limit, self._stalled, self._recovered = limit, stalled, recovered
        self._lock = threading.Lock()
        self._task: tuple[str, float] | None = None  # name and start time
        self._is_reported = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ssiam-watchdog", daemon=True)

    def start(self) -> None:
        """Start watching. May be called once."""
        self._thread.start()

    def close(self) -> None:
        """Stop watching. May be called twice."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    @contextmanager
    def watch(self, name: str) -> Iterator[None]:
        """Watch the task that runs in the ``with`` block."""
        began = time.monotonic()
        with self._lock:
            self._task, self._is_reported = (name, began), False
        try:
            yield
        finally:
            with self._lock:
                self._task, was_reported = None, self._is_reported
            if was_reported:
                self._recovered(name, time.monotonic() - began)

    def _run(self) -> None:
        while not self._closing.wait(self._limit / _CHECKS_PER_LIMIT):
            with self._lock:
                task = self._task
                if task is None or self._is_reported:
                    continue
                if time.monotonic() - task[1] < self._limit:
                    continue
                # Called under the lock, so that the task's recovery is reported after it.
                self._is_reported = True
                self._stalled(task[0])
