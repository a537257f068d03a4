"""Where the live page listens, what it goes by there, and whom it lets in."""

from __future__ import annotations

import ipaddress
import secrets
import socket
from typing import Final

from ssiam.errors import SsiamError
from ssiam.web.server.guard import LOOPBACK, Access

_TOKEN_BYTES: Final = 32
_BACKLOG: Final = 128
_MOST_PORTS: Final = 65535
# Of a network for documentation: nothing is sent to it, it only tells the way out.
_FAR_AWAY: Final = ("192.0.2.1", 9)


class ServerError(SsiamError):
    """An address that cannot be listened on."""


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens on a name or address; port 0 takes a free one.

    Raises
    ------
    ServerError
        There is no such address here, or the port is taken or not allowed.
    """
    if not 0 <= port <= _MOST_PORTS:
        raise ServerError(f"port {port} does not exist: choose one of 1024 to {_MOST_PORTS}")
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, _, _, _, address = found[0]
        # All addresses of version 6 are those of version 4 too, where the system can do that.
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
    """Who may use what listens on `host`: others than this machine always need a token."""
    address, port = listener.getsockname()[:2]
    place = ipaddress.ip_address(address)
    token = None
    if needs_token or not place.is_loopback:
        token = secrets.token_urlsafe(_TOKEN_BYTES)
    names = LOOPBACK | {host.lower(), address}
    if place.is_unspecified:
        machine = socket.gethostname().lower()
        names |= {machine, machine.partition(".")[0] + ".local"}
    return Access(port, names, place.is_unspecified, token)


def page_address(listener: socket.socket, access: Access) -> str:
    """What to open in a browser, with the token where one is needed."""
    address = listener.getsockname()[0]
    if access.any_address:
        address = _own_address()
    name = f"[{address}]" if ":" in address else address
    token = "" if access.token is None else f"#token={access.token}"
    return f"http://{name}:{access.port}/{token}"


def _own_address() -> str:
    """The address by which other machines are likely to reach this one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_FAR_AWAY)
        except OSError:
            return "127.0.0.1"
        return str(probe.getsockname()[0])
