"""Addresses of sources, and their names in messages, which never contain a password."""

from __future__ import annotations

import os
import re
import traceback
from collections.abc import Iterable, Sequence
from typing import Final
from urllib.parse import urlsplit

_ADDRESS: Final = re.compile(r"[a-z][a-z0-9+.-]*://", re.IGNORECASE)
# A scheme as people type it: after blanks or quotes, with one slash or several, and inside one of
# FFmpeg's protocols that wrap another. Windows' drives have one letter.
_SCHEME: Final = re.compile(
    r"[\s'\"]*((?:(?:async|cache|concat|crypto|hls)[:+])?[a-z][a-z0-9+.-]+):/+", re.IGNORECASE
)
_HOST: Final = re.compile(r"[\w.-]+|[0-9a-f:.]*:[0-9a-f:.]*")  # a name, IPv4 or IPv6
_HIDDEN: Final = "..."
_LEAST_QUOTED: Final = 8  # characters by which the beginning of an address without scheme is found


def is_address(spec: str) -> bool:
    """Whether `spec` is a URL (``scheme://...``) and not a path."""
    return _ADDRESS.match(spec) is not None


def has_scheme(spec: str) -> bool:
    """Whether `spec` begins like a URL, also with typing errors or as a path (``scheme:/...``)."""
    return _SCHEME.match(spec) is not None


def display_name(spec: str) -> str:
    """A source as it may be printed: the path of a file as it is, an address redacted.

    What is no file and looks like an address with a typing error counts as an address.
    """
    if not is_address(spec) and (os.path.lexists(spec) or not _looks_like_address(spec)):
        return spec
    return redact_address(spec)


def redact_words(text: str, words: Iterable[str]) -> str:
    """`text`, a message, in which each command-line word that is an address is redacted.

    Messages may quote a word in part, with escapes, or as a path; its secret parts are removed
    there too.
    """
    for word in words:
        value = word.partition("=")[2] if word.startswith("--") else word
        shown = display_name(value)
        if shown == value:
            continue
        scheme = _SCHEME.match(value)
        least = scheme.end() + 1 if scheme else _LEAST_QUOTED
        text = _without_beginnings(text, (value, repr(value)[1:-1]), shown, least)
        for secret in sorted({*_parts(value)} - {*_parts(shown)}, key=len, reverse=True):
            if secret not in text:  # faster than the expression, above all for long ones
                continue
            text = re.sub(rf"(?<!\w){re.escape(secret)}(?!\w)", _HIDDEN, text)
    return text


def redact_address(address: str) -> str:
    """Scheme, host, port and path of an address; the rest may hold secrets.

    Parts that can also be a piece of a password, because it contains ``/``, ``?``, ``#`` or ``@``
    as they are, are replaced by ``...``, and so are values in the path (``/password=...``).
    """
    scheme = _SCHEME.match(address)
    prefix = f"{scheme[1]}://" if scheme else ""
    rest = address[scheme.end() :] if scheme else address
    return prefix + (_location(rest.strip(" \t\r\n'\"")) or _HIDDEN)


def stack_of(error: BaseException) -> str:
    """The stack of an error for logs, without its text, which may contain an address."""
    lines = traceback.format_tb(error.__traceback__)
    return "".join([*lines, type(error).__name__])


def _without_beginnings(text: str, forms: Sequence[str], shown: str, least: int) -> str:
    """`text`, in which `shown` replaces each beginning of a form of at least `least` characters.

    A message that shortens what it quotes ends within the password.
    """
    for form in forms:
        start = 0
        while (start := text.find(form[:least], start)) >= 0:
            end = start + max(_common(each, text[start : start + len(each)]) for each in forms)
            if end > start + len(shown) or not text.startswith(shown, start):
                text = text[:start] + shown + text[end:]
            start += len(shown)
    return text


def _common(first: str, second: str) -> int:
    """Number of characters with which both begin."""
    return next(
        (
            index
            for index, pair in enumerate(zip(first, second, strict=False))
            if pair[0] != pair[1]
        ),
        min(len(first), len(second)),
    )


def _parts(address: str) -> list[str]:
    return [part for part in re.split(r"[/:@?#&=,\s'\"]+", address) if part]


def _looks_like_address(text: str) -> bool:
    """Whether there is a scheme, user:password@ or ?key=value; names of files rarely have them."""
    has_password = 0 <= text.find(":") < text.rfind("@") - 1
    has_query = 0 <= text.find("?") < text.rfind("=")
    return has_scheme(text) or has_password or has_query


def _location(rest: str) -> str | None:
    """Host, port and path of what follows the scheme; None if they cannot be told from secrets."""
    head, query = (*re.split(r"[?#]", rest, maxsplit=1), "")[:2]
    if "@" not in query or ":" not in head:
        # A password may contain a slash; nothing before an @ is kept.
        return _host_port_path(head.rpartition("@")[2])
    if rest.count("@") > 1 or _host_port_path(head) is not None:
        return None  # the @ ends a password, or is a part of a query
    after = query.partition("@")[2]
    return _host_port_path(re.split(r"[?#]", after, maxsplit=1)[0])


def _host_port_path(location: str) -> str | None:
    try:
        parts = urlsplit(f"//{location}")
        host, port = parts.hostname or "", parts.port
    except ValueError:
        return None
    if not _HOST.fullmatch(host):
        return None
    shown = f"[{host}]" if ":" in host else host
    path = re.sub(r"=[^/]*", f"={_HIDDEN}", parts.path)
    return f"{shown}{'' if port is None else f':{port}'}{path}"
