"""A server's connections, each under the eyes of its watch.

uvicorn waits without end for the request of a client that says nothing, and for a client that
does not read what it is sent; here both are cut off.
"""

from __future__ import annotations

import asyncio
from typing import Final, cast

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

from ssiam.web.server.limits import Allowance
from ssiam.web.server.watch import Watch, WatchedConfig

# What the websockets package takes of a handshake; more of it would break it.
_LONGEST_LINE: Final = 8000
_MOST_HEADERS: Final = 100


class _Watched(asyncio.Protocol):
    """Tells the server's watch whether the client reads what it is sent."""

    config: uvicorn.Config
    transport: asyncio.Transport

    @property
    def _watch(self) -> Watch:
        return cast(WatchedConfig, self.config).watch

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        super().connection_lost(exc)
        self._watch.remove(self.transport)

    def pause_writing(self) -> None:
        """The client does not read fast enough."""
        super().pause_writing()
        self._watch.reads(self.transport, False)

    def resume_writing(self) -> None:
        """The client has read."""
        super().resume_writing()
        self._watch.reads(self.transport, True)


class HttpConnection(_Watched, H11Protocol):
    """A connection that has not become a socket (yet)."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin."""
        super().connection_made(transport)
        self._watch.add(transport)

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

    def _tell_watch(self) -> None:
        if self.transport.get_protocol() is self:
            is_asking = self.cycle is not None and not self.cycle.response_complete
            self._watch.asks(self.transport, is_asking)


class SocketConnection(_Watched, WebSocketsSansIOProtocol):
    """A connection that has become a socket."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin."""
        super().connection_made(transport)
        self._watch.asks(self.transport, True)
        often = self._watch.limits.frames_a_second
        self._frames = Allowance(often, often)

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

    def _may_go_on(self) -> bool:
        allowed = self._frames.take()
        if not allowed:
            self._watch.cut_off(self.transport)
        return allowed
