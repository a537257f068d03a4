"""`Guard`: who may ask the server anything; before every request and every socket."""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final, TypeAlias
from urllib.parse import parse_qs

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
    """Who is let in.

    Attributes
    ----------
    port : int
        That the server listens on.
    names : frozenset of str
        Names and addresses that it goes by, in lower case.
    any_address : bool
        Whether it goes by every address, because it listens on all of its machine's. Addresses
        cannot be made to point elsewhere, as names can.
    token : str or None
        What clients must know.
    """

    port: int
    names: frozenset[str] = LOOPBACK
    any_address: bool = False
    token: str | None = None

    def knows(self, host: str) -> bool:
        """Whether a ``Host`` header names this server."""
        name, port = _split(host)
        if port != self.port:
            return False
        return name in self.names or (self.any_address and _is_address(name))

    def admits(self, token: str | None) -> bool:
        """Whether a client with this token may do more than read the page."""
        if self.token is None:
            return True
        return hmac.compare_digest((token or "").encode(), self.token.encode())


class Guard:
    """Lets through what `access` allows, and nothing else; ASGI middleware.

    Wrong ``Host`` (DNS rebinding), foreign ``Origin`` and wrong token: 403, for a socket before it
    opens. Other methods than GET and HEAD: 405. Answers get the headers that keep browsers safe.

    Parameters
    ----------
    app : ASGI application
    access : Access
    is_open : callable
        Whether the page at a path may be read without a token, which its script brings along.
    """

    def __init__(self, app: App, access: Access, is_open: Callable[[str], bool]) -> None:
        self._app, self._access, self._is_open = app, access, is_open

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refused = self._refusal(scope)
        if scope["type"] == "websocket":
            if refused is None:
                await self._app(scope, receive, send)
            else:
                await receive()
                await send({"type": "websocket.close"})
            return
        send = _with_headers(send)
        if refused is None:
            await self._app(scope, receive, send)
        else:
            await _answer(send, refused)

    def _refusal(self, scope: Scope) -> HTTPStatus | None:
        hosts, origins = _values(scope, b"host"), _values(scope, b"origin")
        if len(hosts) != 1 or not self._access.knows(hosts[0]):
            return HTTPStatus.FORBIDDEN
        if origins not in ([], [f"http://{hosts[0]}"]):
            return HTTPStatus.FORBIDDEN
        if scope["type"] == "http":
            if scope["method"] not in ("GET", "HEAD"):
                return HTTPStatus.METHOD_NOT_ALLOWED
            if self._is_open(scope["path"]):
                return None
        return None if self._access.admits(_token(scope)) else HTTPStatus.FORBIDDEN


def _split(host: str) -> tuple[str, int | None]:
    """Name and port of a ``Host`` header, the port None if it cannot be one."""
    name, colon, port = host.rpartition(":")
    if not colon or port.endswith("]"):
        name, port = host, str(_HTTP_PORT)
    if name.startswith("[") and name.endswith("]"):
        name = name[1:-1]
    is_port = port.isascii() and port.isdigit() and len(port) <= len("65535")
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
    """What the request says the token is; None if it says nothing, or two things."""
    said = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
    for key, value in scope["headers"]:
        scheme, _, given = value.decode("latin-1").partition(" ")
        if key == b"authorization" and scheme.lower() == "bearer":
            said.append(given.strip())
    return said[0] if len(set(said)) == 1 else None


def _with_headers(send: Send) -> Send:
    async def send_with_headers(event: Event) -> None:
        if event["type"] == "http.response.start":
            event["headers"] = [*event.get("headers", []), *_SECURITY_HEADERS]
        await send(event)

    return send_with_headers


async def _answer(send: Send, status: HTTPStatus) -> None:
    body = f"{status.value} {status.phrase}\n".encode()
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
    ]
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        headers.append((b"allow", b"GET, HEAD"))
    await send({"type": "http.response.start", "status": int(status), "headers": headers})
    await send({"type": "http.response.body", "body": body})
