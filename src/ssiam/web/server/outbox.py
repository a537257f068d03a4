"""`Outbox`: what a client is sent: texts in their order, and of the steps always the newest."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from starlette.websockets import WebSocket, WebSocketDisconnect

from ssiam.web.server.announcements import step_message
from ssiam.web.server.encoding import StepPictures
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.messages import View

_log = logging.getLogger(__name__)

_UNDER_WAY: Final = 2  # steps that are sent and not acknowledged


class Outbox:
    """Sends to one client; to be used on one event loop.

    Parameters
    ----------
    websocket : WebSocket
        Accepted by the time of `run`.
    limits : ServerLimits
    count : callable
        Number of clients, which steps tell.
    """

    def __init__(
        self, websocket: WebSocket, limits: ServerLimits, count: Callable[[], int]
    ) -> None:
        self._websocket, self._limits, self._count = websocket, limits, count
        self._wake = asyncio.Event()
        self._texts: deque[str] = deque()
        self._is_full = False
        self._is_over = False
        self._view = View()
        self._newest: StepPictures | None = None
        self._sent_number = 0
        self._send_again = False
        # Numbers of steps, and when they were sent.
        self._under_way: deque[tuple[int, float]] = deque()
        self._skipped = 0

    def say(self, text: str) -> None:
        """Send a text message, before the next step."""
        self._is_full = len(self._texts) >= self._limits.unread_texts
        if not self._is_full:
            self._texts.append(text)
        self._wake.set()

    def show(self, newest: StepPictures) -> None:
        """There is a new step."""
        self._newest = newest
        self._wake.set()

    def want(self, view: View) -> None:
        """The client wants to see other pictures, of a session that stands still too."""
        self._send_again = self._send_again or view != self._view
        self._view = view
        self._wake.set()

    def shown(self, number: int) -> None:
        """The client acknowledges a step, and those before it."""
        while self._under_way and self._under_way[0][0] <= number:
            self._under_way.popleft()
        self._wake.set()

    def stop(self) -> None:
        """End `run`. To cancel it is not enough: `asyncio.wait_for` may keep that to itself."""
        self._is_over = True
        self._wake.set()

    async def run(self) -> bool:
        """Send; True when the client does not read or acknowledge, False when it has left."""
        try:
            while not self._is_stalled():
                if self._is_over:
                    return False
                if self._texts:
                    await self._put(text=self._texts.popleft())
                elif self._newest is not None and self._is_due(self._newest):
                    await self._send_step(self._newest)
                else:
                    await self._sleep()
        except WebSocketDisconnect:
            return False
        except asyncio.TimeoutError:
            return True
        return True

    def _is_due(self, newest: StepPictures) -> bool:
        is_new = self._send_again or newest.step.number != self._sent_number
        return is_new and len(self._under_way) < _UNDER_WAY

    async def _send_step(self, newest: StepPictures) -> None:
        step, self._send_again = newest.step, False
        try:
            pictures = await newest.wanted(self._view)
        except Exception:
            # The client is sent the next step in its place.
            _log.exception("step %d cannot be shown", step.number)
            self._sent_number = step.number
            return
        if self._sent_number:
            self._skipped += max(0, step.number - self._sent_number - 1)
        self._sent_number = step.number
        self._under_way.append((step.number, time.monotonic()))
        message = step_message(step, pictures, skipped=self._skipped, clients=self._count())
        await self._put(bytes=message)

    async def _put(self, **message: str | bytes) -> None:
        sending = self._websocket.send({"type": "websocket.send", **message})
        await asyncio.wait_for(sending, self._limits.stall_seconds)

    async def _sleep(self) -> None:
        """Wait for news, at most until the client should have acknowledged."""
        self._wake.clear()
        left = None
        if self._under_way:
            left = self._under_way[0][1] + self._limits.stall_seconds - time.monotonic()
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._wake.wait(), left)

    def _is_stalled(self) -> bool:
        if not self._under_way:
            return self._is_full
        waited = time.monotonic() - self._under_way[0][1]
        return self._is_full or waited >= self._limits.stall_seconds
