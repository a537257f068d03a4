"""`Watch`: every connection of a server, and how long it may keep the server waiting.

uvicorn waits without end for the request of a client that says nothing, and for a client that
does not read what it is sent; here both are cut off.
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass
from typing import Final, cast

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

from ssiam.web.server.limits import Allowance, ServerLimits

# What the websockets package takes of a handshake; more of it would break it.
_LONGEST_LINE: Final = 8000
_MOST_HEADERS: Final = 100


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


class HttpConnection(H11Protocol):
    """A connection that has not become a socket (yet)."""

    @property
    def _watch(self) -> Watch:
        return cast(WatchedConfig, self.config).watch

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin."""
        super().connection_made(transport)
        self._watch.add(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        super().connection_lost(exc)
        self._watch.remove(self.transport)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request."""
        super().data_received(data)
        self._tell_watch()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._tell_watch()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Become a socket."""
        lines = [event.target, *(name + value for name, value in event.headers)]
        if len(lines) > _MOST_HEADERS or max(map(len, lines)) > _LONGEST_LINE:
            self.send_400_response("The request is too long.")
            return
        super().handle_websocket_upgrade(event)

    def pause_writing(self) -> None:
        """The client does not read fast enough."""
        super().pause_writing()
        self._watch.reads(self.transport, False)

    def resume_writing(self) -> None:
        """The client has read."""
        super().resume_writing()
        self._watch.reads(self.transport, True)

    def _tell_watch(self) -> None:
        if self.transport.get_protocol() is self:
            is_asking = self.cycle is not None and not self.cycle.response_complete
            self._watch.asks(self.transport, is_asking)


class SocketConnection(WebSocketsSansIOProtocol):
    """A connection that has become a socket."""

    @property
    def _watch(self) -> Watch:
        return cast(WatchedConfig, self.config).watch

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin."""
        super().connection_made(transport)
        self._watch.asks(self.transport, True)
        often = self._watch.limits.frames_a_second
        self._frames = Allowance(often, often)

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        super().connection_lost(exc)
        self._watch.remove(self.transport)

    def data_received(self, data: bytes) -> None:
        """Take a part of a message."""
        super().data_received(data)
        # Pings are answered at once, whether the client listens or not.
        if self.transport.get_write_buffer_size() > self._watch.limits.unread_bytes:
            self._watch.cut_off(self.transport)

    def handle_cont(self, event: Frame) -> None:
        """Take one more part of a message; parts of no size do not make it too large."""
        if self._may_go_on():
            super().handle_cont(event)

    def handle_ping(self) -> None:
        """Answer a ping."""
        if self._may_go_on():
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        """Take the answer to a ping."""
        if self._may_go_on():
            super().handle_pong(event)

    def pause_writing(self) -> None:
        """The client does not read fast enough."""
        super().pause_writing()
        self._watch.reads(self.transport, False)

    def resume_writing(self) -> None:
        """The client has read."""
        super().resume_writing()
        self._watch.reads(self.transport, True)

    def _may_go_on(self) -> bool:
        allowed = self._frames.take()
        if not allowed:
            self._watch.cut_off(self.transport)
        return allowed
