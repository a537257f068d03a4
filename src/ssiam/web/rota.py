"""`Rota`: those who want to be told."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

_log = logging.getLogger(__name__)

News = TypeVar("News")


class Rota(Generic[News]):
    """Listeners that come and go on any thread; each is called on the thread that tells."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listeners: tuple[Callable[[News], object], ...] = ()

    def add(self, listener: Callable[[News], object]) -> Callable[[], None]:
        """Call `listener` with all news from now on; what is returned ends it."""
        with self._lock:
            self._listeners = (*self._listeners, listener)

        def end() -> None:
            with self._lock:
                kept = (each for each in self._listeners if each is not listener)
                self._listeners = tuple(kept)

        return end

    def tell(self, news: News) -> None:
        """Tell everybody, one after the other; a listener that raises keeps it from no other."""
        for listener in self._listeners:
            try:
                listener(news)
            except Exception:
                _log.exception("a listener failed")
