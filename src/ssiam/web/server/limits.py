"""`ServerLimits`: what the server of the live page accepts from its clients."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class ServerLimits:
    """Limits per client, and on their number.

    Attributes
    ----------
    clients : int
        WebSocket clients at a time.
    connections : int
        Connections of all kinds at a time. A further one replaces the connection that has been
        idle for longest.
    message_bytes : int
        Size of a text message.
    image_bytes : int
        Size of a JPEG from a browser's camera.
    image_pixels : int
        Number of pixels of such a JPEG.
    messages_per_second : float
        Average rate of messages.
    burst : int
        Messages that may arrive at once.
    frames_per_second : int
        Rate of WebSocket control and continuation frames, and the number that may arrive at once.
    bad_messages : int
        Invalid messages before the client is disconnected.
    pending_commands : int
        Commands that are not answered yet.
    stall_seconds : float
        Time for a client to read or acknowledge what it was sent.
    handshake_seconds : float
        Time from the connection to the complete request, and from the end to the last byte.
    head_bytes : int
        Size of a request's line and headers.
    unread_texts, unread_bytes : int
        Text messages and bytes that are buffered for a client that does not read.
    """

    clients: int = 8
    connections: int = 64
    message_bytes: int = 65_536
    image_bytes: int = 4 * 1024 * 1024
    image_pixels: int = 4096 * 4096
    messages_per_second: float = 200
    burst: int = 400
    frames_per_second: int = 1000
    bad_messages: int = 20
    pending_commands: int = 64
    stall_seconds: float = 10
    handshake_seconds: float = 5
    head_bytes: int = 16_384
    unread_texts: int = 1000
    unread_bytes: int = 32 * 1024 * 1024


class TokenBucket:
    """A rate limit that allows bursts.

    Parameters
    ----------
    per_second : float
    burst : int
    clock : callable
        Seconds.
    """

    def __init__(
        self, per_second: float, burst: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._per_second, self._burst, self._clock = per_second, burst, clock
        self._tokens, self._updated = float(burst), clock()

    def take(self) -> bool:
        """Take a token; False if there is none."""
        now = self._clock()
        self._tokens = min(self._burst, self._tokens + (now - self._updated) * self._per_second)
        self._updated = now
        if self._tokens < 1:
            return False
        self._tokens -= 1
        return True
