"""`ClientSocket`: the WebSocket of one client that watches and controls a session."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, Final

from starlette.websockets import WebSocket, WebSocketDisconnect

from ssiam.errors import SsiamError, one_line
from ssiam.web.server.images import BrowserCamera, StepImages
from ssiam.web.server.incoming import Acknowledge, BadMessage, Message, View
from ssiam.web.server.limits import ServerLimits, TokenBucket
from ssiam.web.server.outgoing import done_message, error_message, step_message
from ssiam.web.server.service import Service
from ssiam.web.types import CommandError

_log = logging.getLogger(__name__)

# Close codes of WebSocket (RFC 6455, 7.4.1, and the IANA registry).
GOING_AWAY: Final = 1001
POLICY_VIOLATION: Final = 1008
MESSAGE_TOO_BIG: Final = 1009
TRY_AGAIN_LATER: Final = 1013

_CLOSE_TIMEOUT: Final = 1.0  # seconds to send the close frame
_MAX_UNACKNOWLEDGED: Final = 2  # steps that are sent and not acknowledged


class Outbox:
    """Sends to one client: all texts in order, and the newest step. For one event loop.

    Parameters
    ----------
    websocket : WebSocket
        Accepted before `run`.
    limits : ServerLimits
    count : callable
        Number of clients, which is part of each step's message.
    """

    def __init__(
        self, websocket: WebSocket, limits: ServerLimits, count: Callable[[], int]
    ) -> None:
        self._websocket, self._limits, self._count = websocket, limits, count
        self._wake = asyncio.Event()
        self._texts: deque[str] = deque()
        self._is_full = False
        self._is_stopped = False
        self._view = View()
        self._newest: StepImages | None = None
        self._sent_number = 0
        self._send_again = False
        self._unacknowledged: deque[tuple[int, float]] = deque()  # step number, time of sending
        self._skipped = 0

    def send(self, text: str) -> None:
        """Send a text message, before the next step."""
        self._is_full = len(self._texts) >= self._limits.unread_texts
        if not self._is_full:
            self._texts.append(text)
        self._wake.set()

    def send_step(self, newest: StepImages) -> None:
        """Send a step as soon as possible, unless a newer one arrives before."""
        self._newest = newest
        self._wake.set()

    def set_view(self, view: View) -> None:
        """Change the images that the client requests; the newest step is sent again."""
        self._send_again = self._send_again or view != self._view
        self._view = view
        self._wake.set()

    def acknowledge(self, number: int) -> None:
        """Note that the client has received this step and those before it."""
        while self._unacknowledged and self._unacknowledged[0][0] <= number:
            self._unacknowledged.popleft()
        self._wake.set()

    def stop(self) -> None:
        """End `run`. Cancelling it is not enough: `asyncio.wait_for` may swallow that."""
        self._is_stopped = True
        self._wake.set()

    async def run(self) -> bool:
        """Send until the end; return True if the client stalls, False if it has left."""
        try:
            while not self._is_stalled():
                if self._is_stopped:
                    return False
                if self._texts:
                    await self._put(text=self._texts.popleft())
                elif self._newest is not None and self._is_due(self._newest):
                    await self._put_step(self._newest)
                else:
                    await self._sleep()
        except WebSocketDisconnect:
            return False
        except asyncio.TimeoutError:
            return True
        return True

    def _is_due(self, newest: StepImages) -> bool:
        is_new = self._send_again or newest.step.number != self._sent_number
        return is_new and len(self._unacknowledged) < _MAX_UNACKNOWLEDGED

    async def _put_step(self, newest: StepImages) -> None:
        step, self._send_again = newest.step, False
        try:
            images = await newest.encoded(self._view)
        except Exception:
            # The client gets the next step instead.
            _log.exception("step %d cannot be encoded", step.number)
            self._sent_number = step.number
            return
        if self._sent_number:
            self._skipped += max(0, step.number - self._sent_number - 1)
        self._sent_number = step.number
        self._unacknowledged.append((step.number, time.monotonic()))
        message = step_message(step, images, skipped=self._skipped, clients=self._count())
        await self._put(bytes=message)

    async def _put(self, **message: str | bytes) -> None:
        sending = self._websocket.send({"type": "websocket.send", **message})
        await asyncio.wait_for(sending, self._limits.stall_seconds)

    async def _sleep(self) -> None:
        """Wait for something to send, at most until an acknowledgment is overdue."""
        self._wake.clear()
        left = None
        if self._unacknowledged:
            left = self._unacknowledged[0][1] + self._limits.stall_seconds - time.monotonic()
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._wake.wait(), left)

    def _is_stalled(self) -> bool:
        if not self._unacknowledged:
            return self._is_full
        waited = time.monotonic() - self._unacknowledged[0][1]
        return self._is_full or waited >= self._limits.stall_seconds


class ClientSocket:
    """One client: receives its messages and sends it the newest steps. For one event loop.

    Parameters
    ----------
    websocket : WebSocket
        Not accepted yet.
    service : Service
    camera : BrowserCamera
    limits : ServerLimits
    count : callable
        Number of clients.
    """

    def __init__(
        self,
        websocket: WebSocket,
        service: Service,
        camera: BrowserCamera,
        limits: ServerLimits,
        count: Callable[[], int],
    ) -> None:
        self._websocket, self._service = websocket, service
        self._camera, self._limits = camera, limits
        self._outbox = Outbox(websocket, limits, count)
        self._loop = asyncio.get_running_loop()
        self._close_code: asyncio.Future[int] = self._loop.create_future()
        self._bad_messages = 0
        self._pending_commands = 0

    async def run(self) -> None:
        """Serve the client until it leaves or is disconnected."""
        await self._websocket.accept()
        sending = asyncio.create_task(self._outbox.run())
        receiving = asyncio.create_task(self._receive())
        ends: list[asyncio.Future[Any]] = [self._close_code, sending, receiving]
        try:
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
            code = self._code(sending, receiving)
        finally:
            self._camera.release(self)
            self._outbox.stop()
            for task in (sending, receiving):
                task.cancel()
            await asyncio.gather(sending, receiving, return_exceptions=True)
        if code is not None:
            await self._close(code)

    def send_step(self, newest: StepImages) -> None:
        """Send a step, unless a newer one arrives before."""
        self._outbox.send_step(newest)

    def send(self, text: str) -> None:
        """Send a text message."""
        self._outbox.send(text)

    def end(self, code: int) -> None:
        """Disconnect the client."""
        if not self._close_code.done():
            self._close_code.set_result(code)

    def _code(self, sending: asyncio.Task[bool], receiving: asyncio.Task[int | None]) -> int | None:
        """The close code; None if the client has left."""
        if receiving.done():
            return receiving.result()
        if sending.done():
            return TRY_AGAIN_LATER if sending.result() else None
        return self._close_code.result()

    async def _close(self, code: int) -> None:
        # A client that does not read never receives the close frame.
        with suppress(asyncio.TimeoutError, WebSocketDisconnect):
            await asyncio.wait_for(self._websocket.close(code), _CLOSE_TIMEOUT)

    async def _receive(self) -> int | None:
        """Process messages; return the close code, or None when the client has left."""
        bucket = TokenBucket(self._limits.messages_per_second, self._limits.burst)
        while self._bad_messages < self._limits.bad_messages:
            event = await self._websocket.receive()
            if event["type"] == "websocket.disconnect":
                return None
            if not bucket.take():
                return POLICY_VIOLATION
            text, image = event.get("text"), event.get("bytes")
            if text is not None and len(text.encode()) > self._limits.message_bytes:
                return MESSAGE_TOO_BIG
            if text is not None:
                self._take_text(text)
            elif self._service.takes_images:
                self._take_image(image or b"")
            else:
                return POLICY_VIOLATION
            # A client that sends without pause must not starve the others.
            await asyncio.sleep(0)
        return POLICY_VIOLATION

    def _take_text(self, text: str) -> None:
        ask = None
        try:
            message = self._service.parse(text)
            ask = message.ask
            self._take(message)
        except BadMessage as error:
            self._bad_messages += error.code == "bad-message"
            self.send(error_message(error.ask, error))
        except CommandError as error:
            self.send(error_message(ask, error))

    def _take(self, message: Message) -> None:
        content, ask = message.content, message.ask
        if isinstance(content, Acknowledge):
            self._outbox.acknowledge(content.number)
        elif isinstance(content, View):
            self._outbox.set_view(content)
        else:
            self._submit(content, ask)
            return
        if ask is not None:
            self.send(done_message(ask, None))

    def _submit(self, command: Any, ask: int | None) -> None:
        if self._pending_commands >= self._limits.pending_commands:
            text = "too many commands are pending: wait for their answers"
            raise CommandError("not-possible", text)
        self._pending_commands += 1
        answer = self._service.submit(command)
        answer.add_done_callback(lambda answer: call_on(self._loop, self._on_answer, ask, answer))

    def _on_answer(self, ask: int | None, answer: Future[Any]) -> None:
        self._pending_commands -= 1
        error = answer.exception()
        if isinstance(error, SsiamError):
            self.send(error_message(ask, error))
        elif error is not None:
            self.send(error_message(ask, CommandError("failed", one_line(error))))
        elif ask is not None:
            self.send(done_message(ask, answer.result()))

    def _take_image(self, jpeg: bytes) -> None:
        try:
            pushed = self._camera.take(self, jpeg)
        except CommandError as error:
            self.send(error_message(None, error))
            return
        if pushed is not None:
            pushed.add_done_callback(self._on_pushed)

    def _on_pushed(self, pushed: asyncio.Future[None]) -> None:
        error = pushed.exception()
        if isinstance(error, SsiamError):
            self._bad_messages += 1
            self.send(error_message(None, CommandError("bad-message", str(error))))
        elif error is not None:
            _log.error("a frame of a browser's camera", exc_info=error)
            self.send(error_message(None, CommandError("failed", one_line(error))))


def call_on(loop: asyncio.AbstractEventLoop, callback: Callable[..., None], *args: Any) -> None:
    """Call `callback` on the loop's thread, from any thread; ignored if the loop has ended."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(callback, *args)
