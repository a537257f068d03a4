"""`Watchdog`: notices work that does not come to an end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

_LOOKS: Final = 5  # at the work, in the time that it may take


class Watchdog:
    """Watches the work of one thread from a thread of its own.

    Parameters
    ----------
    patience : float
        Seconds that a piece of work may take.
    stalled : callable
        Called on the watchdog's thread with the name of work that takes longer, once for each;
        must not wait for the working thread.
    ended : callable
        Called on the working thread when such work has ended after all, with its name and the
        seconds that it took.
    """

    def __init__(
        self,
        patience: float,
        stalled: Callable[[str], None],
        ended: Callable[[str, float], None],
    ) -> None:
        self._patience, self._stalled, self._ended = patience, stalled, ended
        self._lock = threading.Lock()
        self._work: tuple[str, float] | None = None  # its name, and when it began
        self._reported = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ssiam-watchdog", daemon=True)

    def start(self) -> None:
        """Begin to watch; to be called once."""
        self._thread.start()

    def close(self) -> None:
        """Watch no longer. May be called twice."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    @contextmanager
    def over(self, name: str) -> Iterator[None]:
        """Watch over the work that is done inside."""
        began = time.monotonic()
        with self._lock:
            self._work, self._reported = (name, began), False
        try:
            yield
        finally:
            with self._lock:
                self._work, reported = None, self._reported
            if reported:
                self._ended(name, time.monotonic() - began)

    def _run(self) -> None:
        while not self._closing.wait(self._patience / _LOOKS):
            with self._lock:
                work = self._work
                if work is None or self._reported:
                    continue
                if time.monotonic() - work[1] < self._patience:
                    continue
                # Still with the lock: the end of this work is told after it.
                self._reported = True
                self._stalled(work[0])
