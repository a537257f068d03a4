"""`Watch`: how long each connection may keep the server waiting."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

import uvicorn

from ssiam.web.server.limits import ServerLimits


@dataclass
class _Waiting:
    """Since when a connection keeps the server waiting, seconds of the monotonic clock."""

    request: float | None = None
    reading: float | None = None
    ending: float | None = None


class Watch:
    """Cuts off connections that take too long, and those that are too many.

    Parameters
    ----------
    limits : ServerLimits
    """

    def __init__(self, limits: ServerLimits) -> None:
        self.limits = limits
        self._waiting: dict[asyncio.Transport, _Waiting] = {}

    def add(self, transport: asyncio.Transport) -> None:
        """A connection was made; its request is awaited."""
        self._waiting[transport] = _Waiting(request=time.monotonic())
        if len(self._waiting) > self.limits.connections:
            self.cut_off(self._longest_silent(transport))

    def remove(self, transport: asyncio.Transport) -> None:
        """A connection has ended."""
        self._waiting.pop(transport, None)

    def asks(self, transport: asyncio.Transport, asks: bool) -> None:
        """Whether a request of the connection is being answered."""
        waiting = self._waiting.get(transport)
        if waiting is not None:
            # A byte now and then is no request: the time runs on.
            waiting.request = None if asks else waiting.request or time.monotonic()

    def reads(self, transport: asyncio.Transport, reads: bool) -> None:
        """Whether the client reads what it is sent."""
        waiting = self._waiting.get(transport)
        if waiting is not None:
            waiting.reading = None if reads else time.monotonic()

    def cut_off(self, transport: asyncio.Transport) -> None:
        """End a connection at once."""
        self.remove(transport)
        transport.abort()

    def sweep(self) -> None:
        """Cut off what takes too long; to be called several times a second."""
        now = time.monotonic()
        for transport, waiting in list(self._waiting.items()):
            if waiting.ending is None and transport.is_closing():
                waiting.ending = now
            if self._is_overdue(waiting, now):
                self.cut_off(transport)

    def _is_overdue(self, waiting: _Waiting, now: float) -> bool:
        short, long = self.limits.handshake_seconds, self.limits.stall_seconds
        allowed = ((waiting.request, short), (waiting.ending, short), (waiting.reading, long))
        return any(since is not None and now - since > most for since, most in allowed)

    def _longest_silent(self, newcomer: asyncio.Transport) -> asyncio.Transport:
        silent = {t: w.request for t, w in self._waiting.items() if w.request is not None}
        return min(silent, key=silent.__getitem__, default=newcomer)


class WatchedConfig(uvicorn.Config):
    """Settings of a server whose connections are watched."""

    watch: Watch
