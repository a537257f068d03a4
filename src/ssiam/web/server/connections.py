"""uvicorn's connections with time limits (`ConnectionWatch`).

uvicorn waits indefinitely for the request of a silent client, and for a client that does not read.
Here, both are disconnected.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, cast

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

from ssiam.web.server.limits import ServerLimits, TokenBucket

# Limits of the websockets package's handshake parser; longer requests would crash it.
_MAX_LINE_BYTES: Final = 8000
_MAX_HEADERS: Final = 100


@dataclass
class _Waiting:
    """When the server began to wait for a connection: `time.monotonic`, or None if it does not."""

    for_request: float | None = None
    for_reading: float | None = None
    for_end: float | None = None


class ConnectionWatch:
    """Closes connections that exceed the time limits or the maximum number.

    Parameters
    ----------
    limits : ServerLimits
    """

    def __init__(self, limits: ServerLimits) -> None:
        self.limits = limits
        self._waiting: dict[asyncio.Transport, _Waiting] = {}

    def add(self, transport: asyncio.Transport) -> None:
        """Add a new connection, which must now send its request."""
        self._waiting[transport] = _Waiting(for_request=time.monotonic())
        if len(self._waiting) > self.limits.connections:
            self.abort(self._longest_idle(transport))

    def remove(self, transport: asyncio.Transport) -> None:
        """Remove a connection that has ended."""
        self._waiting.pop(transport, None)

    def set_requesting(self, transport: asyncio.Transport, is_requesting: bool) -> None:
        """Set whether a request of the connection is being answered."""
        waiting = self._waiting.get(transport)
        if waiting is not None:
            # An incomplete request does not restart the time limit.
            waiting.for_request = None if is_requesting else waiting.for_request or time.monotonic()

    def set_reading(self, transport: asyncio.Transport, is_reading: bool) -> None:
        """Set whether the client reads what it is sent."""
        waiting = self._waiting.get(transport)
        if waiting is not None:
            waiting.for_reading = None if is_reading else time.monotonic()

    def abort(self, transport: asyncio.Transport) -> None:
        """Close a connection at once."""
        self.remove(transport)
        transport.abort()

    def sweep(self) -> None:
        """Close overdue connections. To be called several times per second."""
        now = time.monotonic()
        for transport, waiting in list(self._waiting.items()):
            if waiting.for_end is None and transport.is_closing():
                waiting.for_end = now
            if self._is_overdue(waiting, now):
                self.abort(transport)

    def _is_overdue(self, waiting: _Waiting, now: float) -> bool:
        handshake, stall = self.limits.handshake_seconds, self.limits.stall_seconds
        limits = (
            (waiting.for_request, handshake),
            (waiting.for_end, handshake),
            (waiting.for_reading, stall),
        )
        return any(since is not None and now - since > limit for since, limit in limits)

    def _longest_idle(self, newcomer: asyncio.Transport) -> asyncio.Transport:
        idle = {t: w.for_request for t, w in self._waiting.items() if w.for_request is not None}
        return min(idle, key=idle.__getitem__, default=newcomer)


class WatchedConfig(uvicorn.Config):
    """Settings of a server whose connections are watched.

    Parameters
    ----------
    app : ASGI application
    watch : ConnectionWatch
    settings
        As for `uvicorn.Config`.
    """

    def __init__(self, app: Callable[..., Any], watch: ConnectionWatch, **settings: Any) -> None:
        self.watch = watch
        super().__init__(app, **settings)


class _Watched(asyncio.Protocol):
    """Base of the protocols: reports to the watch whether the client reads what it is sent."""

    config: uvicorn.Config
    transport: asyncio.Transport

    @property
    def _watch(self) -> ConnectionWatch:
        return cast(WatchedConfig, self.config).watch

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the connection from the watch."""
        super().connection_lost(exc)
        self._watch.remove(self.transport)

    def pause_writing(self) -> None:
        """Report that the write buffer is full: the client does not read fast enough."""
        super().pause_writing()
        self._watch.set_reading(self.transport, False)

    def resume_writing(self) -> None:
        """Report that the client has read."""
        super().resume_writing()
        self._watch.set_reading(self.transport, True)


class HttpConnection(_Watched, H11Protocol):
    """An HTTP connection, which may be upgraded to a WebSocket."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start watching the connection."""
        super().connection_made(transport)
        self._watch.add(transport)

    def data_received(self, data: bytes) -> None:
        """Process a part of a request."""
        super().data_received(data)
        self._update_watch()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._update_watch()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Upgrade to a WebSocket."""
        lines = [event.target, *(name + value for name, value in event.headers)]
        if len(lines) > _MAX_HEADERS or max(map(len, lines)) > _MAX_LINE_BYTES:
            self.send_400_response("The request is too long.")
            return
        super().handle_websocket_upgrade(event)

    def _update_watch(self) -> None:
        if self.transport.get_protocol() is self:
            is_requesting = self.cycle is not None and not self.cycle.response_complete
            self._watch.set_requesting(self.transport, is_requesting)


class SocketConnection(_Watched, WebSocketsSansIOProtocol):
    """A WebSocket connection."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        rate = self._watch.limits.frames_per_second
        self._frames = TokenBucket(rate, rate)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start watching the connection."""
        super().connection_made(transport)
        self._watch.set_requesting(self.transport, True)

    def data_received(self, data: bytes) -> None:
        """Process a part of a message."""
        super().data_received(data)
        # Pings are answered at once, even if the client does not read the answers.
        if self.transport.get_write_buffer_size() > self._watch.limits.unread_bytes:
            self._watch.abort(self.transport)

    def handle_cont(self, event: Frame) -> None:
        """Process a continuation frame; empty ones never reach the size limit."""
        if self._take_frame():
            super().handle_cont(event)

    def handle_ping(self) -> None:
        """Answer a ping."""
        if self._take_frame():
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        """Process the answer to a ping."""
        if self._take_frame():
            super().handle_pong(event)

    def _take_frame(self) -> bool:
        """Count a frame; disconnect if there are too many."""
        is_allowed = self._frames.take()
        if not is_allowed:
            self._watch.abort(self.transport)
        return is_allowed
