"""`PageServer`: serves a page on a port of this machine; `LiveServer` serves the live page."""

from __future__ import annotations

import ipaddress
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from ssiam.errors import IncompleteError, MissingExtraError, SsiamError

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
from ssiam.web.server.connections import (
    ConnectionWatch,
    HttpConnection,
    SocketConnection,
    WatchedConfig,
)
from ssiam.web.server.guard import LOOPBACK, Access
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.service import LiveService, Service
from ssiam.web.session import Session

if TYPE_CHECKING:
    from typing_extensions import Self

DEFAULT_PORT: Final = 8765

_DOWNLOAD_TIMEOUT: Final = 2  # seconds for downloads to finish when the server ends
_CHECK_INTERVAL: Final = 0.2  # seconds between two checks of a running server
_FAILURE_DELAY: Final = 1.0  # seconds for clients to learn that the session has failed
_TOKEN_BYTES: Final = 32
_BACKLOG: Final = 128
_MAX_PORT: Final = 65535
# TEST-NET-1 of RFC 5737. Nothing is sent to it; connecting selects the outgoing interface.
_REMOTE_ADDRESS: Final = ("192.0.2.1", 9)


class ServerError(SsiamError):
    """The server cannot listen on an address."""


class PageServer:
    """Serves a page and its WebSocket on its own thread. A context manager.

    Clients need a token on the loopback too: other users of the machine can connect to it.

    Parameters
    ----------
    service : Service
        Its session is started and closed by the caller.
    host : str
        Name or address to listen on; ``0.0.0.0`` for all addresses of the machine.
    port : int
        0 selects a free one.
    needs_token : bool
        If False, whoever reaches the port may connect.
    limits : ServerLimits, optional

    Attributes
    ----------
    access : Access
        Who may connect.
    url : str
        URL of the page without the token, for messages.
    address : str
        What to open in a browser: `url`, and in its fragment the token if one is needed.

    Raises
    ------
    ServerError
        The server cannot listen on the address.
    """

    def __init__(
        self,
        service: Service,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        *,
        needs_token: bool = True,
        limits: ServerLimits | None = None,
    ) -> None:
        limits = limits or ServerLimits()
        self._service = service
        self._listener = listen(host, port)
        self.access = access_to(self._listener, host, needs_token=needs_token)
        self.url = page_url(self._listener, self.access)
        token = self.access.token
        self.address = self.url if token is None else f"{self.url}#token={token}"
        app = create_app(service, self.access, limits)
        config = _configure(app, limits, takes_images=service.takes_images)
        self._server = _Server(config, app.state.clients)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="ssiam-server", daemon=True)

    @property
    def has_ended(self) -> bool:
        """Whether the server has ended by itself or was closed."""
        return self._ended.is_set()

    @property
    def is_open_to_machines(self) -> bool:
        """Whether other machines can connect without a token."""
        ip = ipaddress.ip_address(self._listener.getsockname()[0])
        return self.access.token is None and not ip.is_loopback

    def start(self) -> None:
        """Start serving; returns when clients can connect. May be called once."""
        self._thread.start()
        self._server.ready.wait()
        if not self._server.started:
            self.close()
            raise ServerError(f"{self.url}: the server did not start; see the log")

    def close(self) -> None:
        """Disconnect all clients and stop. May be called twice."""
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join()
        self._listener.close()

    def __enter__(self) -> Self:
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


class LiveServer(PageServer):
    """Serves a live session's page. A context manager.

    Parameters
    ----------
    session : Session
        Started and closed by the caller.
    host, port, needs_token, limits
        As in `PageServer`.
    """

    def __init__(
        self,
        session: Session,
        host: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        *,
        needs_token: bool = True,
        limits: ServerLimits | None = None,
    ) -> None:
        service = LiveService(session)
        super().__init__(service, host, port, needs_token=needs_token, limits=limits)

    def run(self) -> None:
        """Serve until Ctrl-C, or until the session has failed and its clients were informed.

        Raises
        ------
        IncompleteError
            The server has ended unexpectedly.
        """
        # Not `Thread.join`: if Ctrl-C interrupts it, CPython 3.11 marks the thread as ended.
        with self, suppress(KeyboardInterrupt):
            while not self._ended.wait(_CHECK_INTERVAL):
                if self._service.state == "failed":
                    self._ended.wait(_FAILURE_DELAY)
                    break
            else:
                if not self._server.should_exit:
                    raise IncompleteError(f"{self.url}: the server has ended; see the log")


class _Server(uvicorn.Server):
    """Watches its connections, and disconnects clients before it ends."""

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


def _configure(
    app: Callable[..., Any], limits: ServerLimits, *, takes_images: bool
) -> WatchedConfig:
    return WatchedConfig(
        app,
        ConnectionWatch(limits),
        loop="asyncio",
        http=HttpConnection,
        ws=SocketConnection,
        lifespan="on",
        # By default, uvicorn logs the address of a WebSocket, including its token.
        log_config=None,
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        timeout_keep_alive=max(1, round(limits.handshake_seconds)),
        timeout_graceful_shutdown=_DOWNLOAD_TIMEOUT,
        h11_max_incomplete_event_size=limits.head_bytes,
        ws_max_size=max(limits.message_bytes, limits.image_bytes if takes_images else 0),
        ws_ping_interval=limits.stall_seconds,
        ws_ping_timeout=limits.stall_seconds,
        ws_per_message_deflate=False,
    )


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens on a name or address; port 0 selects a free one.

    Raises
    ------
    ServerError
        The machine does not have the address, or the port is in use or not permitted.
    """
    if not 0 <= port <= _MAX_PORT:
        raise ServerError(f"port {port} does not exist: choose one from 1024 to {_MAX_PORT}")
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, _, _, _, address = found[0]
        # :: also covers IPv4 if the system supports dual-stack sockets.
        both = address[0] == "::" and socket.has_dualstack_ipv6()
        return socket.create_server(
            address[:2], family=family, backlog=_BACKLOG, dualstack_ipv6=both
        )
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ServerError(
            f"cannot listen on {host}, port {port} ({reason}): "
            "choose another with --port, or another --host"
        ) from None


def access_to(listener: socket.socket, host: str, *, needs_token: bool) -> Access:
    """Who may connect to a listener on `host`, with a new token if one is needed."""
    address, port = listener.getsockname()[:2]
    ip = ipaddress.ip_address(address)
    token = secrets.token_urlsafe(_TOKEN_BYTES) if needs_token else None
    names = LOOPBACK | {host.lower(), address}
    if ip.is_unspecified:
        machine = socket.gethostname().lower()
        names |= {machine, machine.partition(".")[0] + ".local"}
    return Access(port, names, ip.is_unspecified, token)


def page_url(listener: socket.socket, access: Access) -> str:
    """The URL of the page, without a token."""
    address = listener.getsockname()[0]
    if access.any_address:
        address = _own_address()
    name = f"[{address}]" if ":" in address else address
    return f"http://{name}:{access.port}/"


def _own_address() -> str:
    """The address at which other machines can probably reach this one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_REMOTE_ADDRESS)
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
