"""`Pace`: how often the tracking status is sent."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Final

from ssiam.web.mavlink.messages import dialect

_IDLE: Final[int] = dialect.CAMERA_TRACKING_STATUS_FLAGS_IDLE
_IDLE_INTERVAL: Final = 1.0  # seconds, where nobody asked for another
_SWITCHED_OFF, _DEFAULT = -1, 0  # in place of microseconds


class Pace:
    """With every step while a target is followed, else once a second; or as was asked for.

    `ask` is for one thread, `is_due` for another.

    Parameters
    ----------
    clock : callable
        Gives seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._asked: float | None = None
        self._next = -math.inf
        self._before = _IDLE

    def ask(self, microseconds: float) -> bool:
        """Take the interval of MAV_CMD_SET_MESSAGE_INTERVAL; whether it can be one."""
        if microseconds == _DEFAULT:
            self._asked = None
        elif microseconds == _SWITCHED_OFF:
            self._asked = math.inf
        elif 0 < microseconds < math.inf:
            self._asked = microseconds / 1e6
        else:
            return False
        return True

    def is_due(self, status: int) -> bool:
        """Whether the status of a new step is to be sent, which is taken as done then."""
        now, interval = self._clock(), self._asked
        if interval is None:
            interval = _IDLE_INTERVAL if status == self._before == _IDLE else 0.0
        # Shorter intervals take effect at once.
        self._next = min(self._next, now + interval)
        if interval == math.inf or now < self._next:
            return False
        # The average is what was asked for, though steps come when they come.
        is_late = now - self._next >= interval
        self._next = (now if is_late else self._next) + interval
        self._before = status
        return True
