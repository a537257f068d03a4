"""`ServerLimits`: what the server of the live page bears from its clients."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class ServerLimits:
    """What one client may do, and how many there may be.

    Attributes
    ----------
    clients : int
        Sockets of the session at a time.
    connections : int
        Connections of all kinds at a time. One more takes the place of the one that has waited
        longest without asking for anything.
    message_bytes : int
        A text message.
    picture_bytes : int
        A picture of a browser's camera.
    picture_pixels : int
        The same, once decoded.
    messages_a_second : float
        On average, of one client.
    burst : int
        Messages of one client at once.
    frames_a_second : int
        Of one client, parts of messages and signs of life; also at once.
    bad_messages : int
        That a client may send before it is shut out.
    waiting : int
        Commands of one client that are not carried out yet.
    stall_seconds : float
        That a client may take to read, or to acknowledge what it was sent.
    handshake_seconds : float
        From the connection to the whole request, and from the end to the last byte.
    head_bytes : int
        Of a request: its line and its headers.
    unread_texts, unread_bytes : int
        Kept for a client that does not read.
    """

    clients: int = 8
    connections: int = 64
    message_bytes: int = 65_536
    picture_bytes: int = 4 * 1024 * 1024
    picture_pixels: int = 4096 * 4096
    messages_a_second: float = 200
    burst: int = 400
    frames_a_second: int = 1000
    bad_messages: int = 20
    waiting: int = 64
    stall_seconds: float = 10
    handshake_seconds: float = 5
    head_bytes: int = 16_384
    unread_texts: int = 1000
    unread_bytes: int = 32 * 1024 * 1024


class Allowance:
    """So many a second, and so many at once: a token bucket.

    Parameters
    ----------
    a_second : float
    burst : int
    clock : callable
        Seconds.
    """

    def __init__(
        self, a_second: float, burst: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._a_second, self._burst, self._clock = a_second, burst, clock
        self._left, self._at = float(burst), clock()

    def take(self) -> bool:
        """Whether one more is allowed now."""
        now = self._clock()
        self._left = min(self._burst, self._left + (now - self._at) * self._a_second)
        self._at = now
        if self._left < 1:
            return False
        self._left -= 1
        return True
