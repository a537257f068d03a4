"""`LiveServer`: the live page on a port of this machine."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

from ssiam.errors import IncompleteError, MissingExtraError

try:
    import uvicorn
    import websockets  # noqa: F401
except ModuleNotFoundError as error:
    if error.name not in ("uvicorn", "websockets"):
        raise
    raise MissingExtraError(
        f"the package {error.name} is not installed, which the live page needs: "
        "pip install 'ssiam[web]'"
    ) from error

from ssiam.web.server.app import create_app
from ssiam.web.server.clients import Clients
from ssiam.web.server.connections import HttpConnection, SocketConnection
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.listening import ServerError, access_to, listen, page_address
from ssiam.web.server.watch import Watch, WatchedConfig
from ssiam.web.session import Session

DEFAULT_PORT: Final = 8765

_GRACE: Final = 2  # seconds for downloads when the server ends
_GLANCE: Final = 0.2  # seconds between two looks at a server that runs
_LAST_WORDS: Final = 1.0  # seconds for clients to hear that the session has failed


class LiveServer:
    """Serves a session's page and socket from a thread; a context manager.

    On the loopback nobody is asked for a token unless `needs_token`; elsewhere everybody is.

    Parameters
    ----------
    session : Session
        Started, and closed, by the caller.
    host : str
        Name or address to listen on; ``0.0.0.0`` for all of the machine's.
    port : int
        0 takes a free one.
    needs_token : bool
    limits : ServerLimits, optional

    Attributes
    ----------
    access : Access
        Who is let in.
    address : str
        What to open in a browser, with the token where one is needed.

    Raises
    ------
    ServerError
        On construction, if the address cannot be listened on.
    """

    def __init__(
        self,
        session: Session,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        *,
        needs_token: bool = False,
        limits: ServerLimits | None = None,
    ) -> None:
        limits = limits or ServerLimits()
        self._session = session
        self._listener = listen(host, port)
        self.access = access_to(self._listener, host, needs_token=needs_token)
        self.address = page_address(self._listener, self.access)
        app = create_app(session, self.access, limits)
        config = _config(app, limits, webcam=session.info.webcam)
        self._server = _Server(config, app.state.clients)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="ssiam-server", daemon=True)

    def start(self) -> None:
        """Begin to serve; returns when clients can connect. To be called once."""
        self._thread.start()
        self._server.ready.wait()
        if not self._server.started:
            self.close()
            raise ServerError(f"{self.address}: the server did not start; its log says why")

    def close(self) -> None:
        """Tell all clients that it is over, and end. May be called twice."""
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join()
        self._listener.close()

    def run(self) -> None:
        """Serve until Ctrl-C, or until the session has failed and its clients know it.

        Raises
        ------
        IncompleteError
            The server has ended by itself.
        """
        # Not Thread.join, which takes a thread for ended when Ctrl-C interrupts it (CPython 3.11).
        with self, suppress(KeyboardInterrupt):
            while not self._ended.wait(_GLANCE):
                if self._session.health.state == "failed":
                    self._ended.wait(_LAST_WORDS)
                    break
            else:
                if not self._server.should_exit:
                    raise IncompleteError(f"{self.address}: the server has ended; see its log")

    def __enter__(self) -> LiveServer:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _serve(self) -> None:
        try:
            self._server.run(sockets=[self._listener])
        finally:
            self._server.ready.set()
            self._ended.set()


class _Server(uvicorn.Server):
    """Cuts off connections that keep it waiting, and says goodbye to clients."""

    def __init__(self, config: WatchedConfig, clients: Clients) -> None:
        super().__init__(config)
        self.ready = threading.Event()
        self._watch, self._clients = config.watch, clients

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.ready.set()

    async def on_tick(self, counter: int) -> bool:
        self._watch.sweep()
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        await self._clients.end()
        await super().shutdown(sockets)


def _config(app: Callable[..., Any], limits: ServerLimits, *, webcam: bool) -> WatchedConfig:
    config = WatchedConfig(
        app,
        loop="asyncio",
        http=HttpConnection,
        ws=SocketConnection,
        lifespan="on",
        # Unless told not to, uvicorn logs the whole address of a socket, its token too.
        log_config=None,
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_keep_alive=max(1, round(limits.handshake_seconds)),
        timeout_graceful_shutdown=_GRACE,
        h11_max_incomplete_event_size=limits.head_bytes,
        ws_max_size=max(limits.message_bytes, limits.picture_bytes if webcam else 0),
        ws_ping_interval=limits.stall_seconds,
        ws_ping_timeout=limits.stall_seconds,
        ws_per_message_deflate=False,
    )
    config.watch = Watch(limits)
    return config
