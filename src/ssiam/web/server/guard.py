"""`Guard`: access control of every request and every WebSocket."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final, TypeAlias
from urllib.parse import parse_qs

from ssiam.parsing import is_number_word

Scope: TypeAlias = MutableMapping[str, Any]
Event: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[Event]]
Send: TypeAlias = Callable[[Event], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]

LOOPBACK: Final = frozenset({"localhost", "127.0.0.1", "::1"})

_HTTP_PORT: Final = 80
_SECURITY_HEADERS: Final = (
    (
        b"content-security-policy",
        b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
        b"connect-src 'self'; media-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'; "
        b"form-action 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cache-control", b"no-store"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
)


@dataclass(frozen=True)
class Access:
    """Who may connect.

    Attributes
    ----------
    port : int
        Port of the server.
    names : frozenset of str
        Names and addresses of the server, in lower case.
    any_address : bool
        Whether every IP address is accepted as the server's, because it listens on all addresses
        of its machine. Unlike names, addresses are not open to DNS rebinding.
    token : str or None
        Token that clients must send; None if they need none. Not part of the representation.
    """

    port: int
    names: frozenset[str] = LOOPBACK
    any_address: bool = False
    token: str | None = field(default=None, repr=False)

    def accepts_host(self, host: str) -> bool:
        """Whether a ``Host`` header names this server."""
        name, port = _split(host)
        if port != self.port:
            return False
        return name in self.names or (self.any_address and _is_address(name))

    def accepts_token(self, token: str | None) -> bool:
        """Whether a client with this token may do more than load the page."""
        if self.token is None:
            return True
        return hmac.compare_digest((token or "").encode(), self.token.encode())


class Guard:
    """ASGI middleware that enforces `access`.

    A wrong ``Host`` (DNS rebinding), a foreign ``Origin`` or a wrong token is answered by 403,
    for a WebSocket before it opens; methods other than GET and HEAD by 405. Security headers are
    added to all responses.

    Parameters
    ----------
    app : ASGI application
    access : Access
    is_public : callable
        Whether a path may be read without a token. The page may: its script sends the token.
    """

    def __init__(self, app: App, access: Access, is_public: Callable[[str], bool]) -> None:
        self._app, self._access, self._is_public = app, access, is_public

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request, or pass it on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if scope["type"] == "websocket":
            if refusal is None:
                await self._app(scope, receive, send)
            else:
                await receive()
                await send({"type": "websocket.close"})
            return
        send = _with_headers(send)
        if refusal is None:
            await self._app(scope, receive, send)
        else:
            await _refuse(send, refusal)

    def _refusal(self, scope: Scope) -> HTTPStatus | None:
        hosts, origins = _values(scope, b"host"), _values(scope, b"origin")
        if len(hosts) != 1 or not self._access.accepts_host(hosts[0]):
            return HTTPStatus.FORBIDDEN
        if origins not in ([], [f"http://{hosts[0]}"]):
            return HTTPStatus.FORBIDDEN
        if scope["type"] == "http":
            if scope["method"] not in ("GET", "HEAD"):
                return HTTPStatus.METHOD_NOT_ALLOWED
            if self._is_public(scope["path"]):
                return None
        return None if self._access.accepts_token(_token(scope)) else HTTPStatus.FORBIDDEN


def _split(host: str) -> tuple[str, int | None]:
    """Name and port of a ``Host`` header; the port is None if it is invalid."""
    name, colon, port = host.rpartition(":")
    if not colon or port.endswith("]"):
        name, port = host, str(_HTTP_PORT)
    if name.startswith("[") and name.endswith("]"):
        name = name[1:-1]
    is_port = is_number_word(port) and len(port) <= len("65535")
    return name, int(port) if is_port else None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _values(scope: Scope, name: bytes) -> list[str]:
    """The values of a header, in lower case."""
    return [value.decode("latin-1").lower() for key, value in scope["headers"] if key == name]


def _token(scope: Scope) -> str | None:
    """The token of a request; None if there is none, or two different ones."""
    tokens = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
    for key, value in scope["headers"]:
        scheme, _, credentials = value.decode("latin-1").partition(" ")
        if key == b"authorization" and scheme.lower() == "bearer":
            tokens.append(credentials.strip())
    return tokens[0] if len(set(tokens)) == 1 else None


def _with_headers(send: Send) -> Send:
    async def send_with_headers(event: Event) -> None:
        if event["type"] == "http.response.start":
            event["headers"] = [*event.get("headers", []), *_SECURITY_HEADERS]
        await send(event)

    return send_with_headers


async def _refuse(send: Send, status: HTTPStatus) -> None:
    body = f"{status.value} {status.phrase}\n".encode()
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
    ]
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        headers.append((b"allow", b"GET, HEAD"))
    await send({"type": "http.response.start", "status": int(status), "headers": headers})
    await send({"type": "http.response.body", "body": body})
