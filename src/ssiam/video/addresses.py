"""Network addresses: how they are opened, and how they are named without their secrets."""

from __future__ import annotations

import re

from ssiam.video.containers import Input, open_container
from ssiam.video.frames import Source
from ssiam.video.levels import Levels

_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]*://", re.IGNORECASE)
# Seconds until a server that does not answer, or that stops sending, counts as gone.
_OPEN_TIMEOUT = 10.0
_READ_TIMEOUT = 10.0


def is_address(spec: str) -> bool:
    """Whether `spec` is a URL (``scheme://...``) and not a path."""
    return _ADDRESS.match(spec) is not None


def public_name(address: str) -> str:
    """The address without user, password, query and fragment, all of which may hold secrets."""
    scheme, _, rest = address.partition("://")
    place = re.split(r"[?#]", rest, maxsplit=1)[0]
    host, slash, path = place.partition("/")
    # A password may hold a slash; nothing in front of an @ is shown.
    return f"{scheme}://{(host + slash + path).rpartition('@')[2]}"


def open_address(
    address: str,
    *,
    silence: float = _READ_TIMEOUT,
    stream: int | None = None,
    levels: Levels | None = None,
    sound: bool = False,
) -> Source:
    """`Source` of a network address; RTSP goes over TCP, which loses no packets.

    After `silence` seconds in which the server sent nothing it counts as gone. The rest is as
    for `open_source`.
    """
    options = {"rtsp_transport": "tcp"} if address.lower().startswith("rtsp") else {}
    return open_container(
        Input(
            name=public_name(address),
            file=address,
            options=options,
            timeout=(_OPEN_TIMEOUT, silence),
            advice="check the address and that the server is up",
            stream=stream,
            levels=levels,
            sound=sound,
            is_remote=True,
        )
    )
