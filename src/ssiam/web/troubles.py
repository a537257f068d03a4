"""`Troubles`: errors that a live session lives through, told to people and to the log."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Final

from ssiam.errors import SsiamError, one_line
from ssiam.web.errors import Note

_log = logging.getLogger(__name__)

_PAUSE: Final = 10.0  # seconds between two notes of the same error
_KINDS: Final = 100  # errors that are remembered; with more of them, all are forgotten


class Troubles:
    """Tells of each error once, and of the same error again after a pause, with a count.

    Parameters
    ----------
    note : callable
        Gets what people should know.
    clock : callable
        Seconds.
    """

    def __init__(
        self, note: Callable[[Note], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._note, self._clock = note, clock
        self._noted: dict[str, float] = {}  # text -> when it was told last
        self._untold: dict[str, int] = {}  # text -> how often it came since then

    def tell(self, what: str, error: Exception) -> str:
        """Tell of an error in `what`; the error as one line."""
        text = one_line(error)
        message = f"{what}: {text}"
        now = self._clock()
        if now - self._noted.get(message, -_PAUSE) < _PAUSE:
            self._untold[message] = self._untold.get(message, 0) + 1
            return text
        if len(self._noted) >= _KINDS:
            self._noted.clear()
            self._untold.clear()
        self._noted[message] = now
        count = self._untold.pop(message, 0)
        times = f" (and {count} times more since it was last reported)" if count else ""
        if isinstance(error, SsiamError):
            _log.info("%s", message)
        else:
            _log.error("%s", message, exc_info=error)
        self._note(Note("error", message + times))
        return text
