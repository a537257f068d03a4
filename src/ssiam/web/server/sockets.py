"""`ClientSocket`: one client that watches and steers a session."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, Final

from starlette.websockets import WebSocket, WebSocketDisconnect

from ssiam.errors import SsiamError, one_line
from ssiam.web.commands import Command
from ssiam.web.errors import CommandError
from ssiam.web.server.announcements import done, hello, refusal
from ssiam.web.server.camera import BrowserCamera
from ssiam.web.server.encoding import StepPictures
from ssiam.web.server.limits import Allowance, ServerLimits
from ssiam.web.server.messages import BadMessage, Message, Shown, View, parse_message
from ssiam.web.server.outbox import Outbox
from ssiam.web.session import Session

_log = logging.getLogger(__name__)

GOING_AWAY: Final = 1001
POLICY: Final = 1008
TOO_BIG: Final = 1009
TRY_AGAIN: Final = 1013

_CLOSING: Final = 1.0  # seconds to tell a client that it is over


class ClientSocket:
    """One client: its commands in, the newest steps out; to be used on one event loop.

    Parameters
    ----------
    websocket : WebSocket
        Not yet accepted.
    session : Session
    camera : BrowserCamera
    limits : ServerLimits
    count : callable
        Number of clients.
    """

    def __init__(
        self,
        websocket: WebSocket,
        session: Session,
        camera: BrowserCamera,
        limits: ServerLimits,
        count: Callable[[], int],
    ) -> None:
        self._websocket, self._session = websocket, session
        self._camera, self._limits = camera, limits
        self._outbox = Outbox(websocket, limits, count)
        self._loop = asyncio.get_running_loop()
        self._over: asyncio.Future[int] = self._loop.create_future()
        self._bad = 0
        self._asked = 0

    async def run(self) -> None:
        """Serve the client until it leaves or is sent away."""
        await self._websocket.accept()
        sending = asyncio.create_task(self._outbox.run())
        receiving = asyncio.create_task(self._receive())
        ends: list[asyncio.Future[Any]] = [self._over, sending, receiving]
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

    def greet(self) -> None:
        """Tell the client what it is connected to."""
        self.say(hello(self._session.info, self._session.limits, self._limits))

    def show(self, newest: StepPictures) -> None:
        """There is a new step."""
        self._outbox.show(newest)

    def say(self, text: str) -> None:
        """Send a text message."""
        self._outbox.say(text)

    def end(self, code: int) -> None:
        """Send the client away."""
        if not self._over.done():
            self._over.set_result(code)

    def _code(self, sending: asyncio.Task[bool], receiving: asyncio.Task[int | None]) -> int | None:
        """What to close with; None where the client has left."""
        if receiving.done():
            return receiving.result()
        if sending.done():
            return TRY_AGAIN if sending.result() else None
        return self._over.result()

    async def _close(self, code: int) -> None:
        # One that does not read will not hear it.
        with suppress(asyncio.TimeoutError, WebSocketDisconnect):
            await asyncio.wait_for(self._websocket.close(code), _CLOSING)

    async def _receive(self) -> int | None:
        """Take messages; what to close with, or None when the client has left."""
        allowance = Allowance(self._limits.messages_a_second, self._limits.burst)
        while self._bad < self._limits.bad_messages:
            event = await self._websocket.receive()
            if event["type"] == "websocket.disconnect":
                return None
            if not allowance.take():
                return POLICY
            text, picture = event.get("text"), event.get("bytes")
            if text is not None and len(text.encode()) > self._limits.message_bytes:
                return TOO_BIG
            if text is not None:
                self._take_text(text)
            elif self._session.info.webcam:
                self._take_picture(picture or b"")
            else:
                return POLICY
            # Who sends without a pause does not keep the others waiting.
            await asyncio.sleep(0)
        return POLICY

    def _take_text(self, text: str) -> None:
        ask = None
        try:
            message = parse_message(text)
            ask = message.ask
            self._take(message)
        except BadMessage as error:
            self._bad += error.code == "bad-message"
            self.say(refusal(error.ask, error))
        except CommandError as error:
            self.say(refusal(ask, error))

    def _take(self, message: Message) -> None:
        content, ask = message.content, message.ask
        if isinstance(content, Shown):
            self._outbox.shown(content.number)
        elif isinstance(content, View):
            self._outbox.want(content)
        else:
            self._submit(content, ask)
            return
        if ask is not None:
            self.say(done(ask, None))

    def _submit(self, command: Command, ask: int | None) -> None:
        if self._asked >= self._limits.waiting:
            raise CommandError("not-possible", "too many commands are waiting: wait for answers")
        self._asked += 1
        answer = self._session.submit(command)
        answer.add_done_callback(lambda answer: call_on(self._loop, self._answered, ask, answer))

    def _answered(self, ask: int | None, answer: Future[Any]) -> None:
        self._asked -= 1
        error = answer.exception()
        if isinstance(error, SsiamError):
            self.say(refusal(ask, error))
        elif error is not None:
            self.say(refusal(ask, CommandError("failed", one_line(error))))
        elif ask is not None:
            self.say(done(ask, answer.result()))

    def _take_picture(self, jpeg: bytes) -> None:
        try:
            pushed = self._camera.take(self, jpeg)
        except CommandError as error:
            self.say(refusal(None, error))
            return
        if pushed is not None:
            pushed.add_done_callback(self._picture_taken)

    def _picture_taken(self, pushed: asyncio.Future[None]) -> None:
        error = pushed.exception()
        if isinstance(error, SsiamError):
            self._bad += 1
            self.say(refusal(None, CommandError("bad-message", str(error))))
        elif error is not None:
            _log.error("a picture of a browser's camera", exc_info=error)
            self.say(refusal(None, CommandError("failed", one_line(error))))


def call_on(loop: asyncio.AbstractEventLoop, callback: Callable[..., None], *args: Any) -> None:
    """Call back on the loop's thread, from any other; not at all if the loop has ended."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(callback, *args)
