"""`Clients`: all clients that watch a session through the server."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from starlette.websockets import WebSocket

from ssiam.web.server.images import BrowserCamera, StepImages
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.outgoing import health_message, note_message, recordings_message
from ssiam.web.server.sockets import GOING_AWAY, ClientSocket, call_on
from ssiam.web.session import Session
from ssiam.web.types import Step

_WORKERS: Final = 2  # threads that encode and decode images
_DISCONNECT_TIMEOUT: Final = 2.0  # seconds for all clients to disconnect when the server ends


class Clients:
    """Accepts clients, and forwards the session's steps and messages to them.

    To be used on one event loop, between `open` and `close`.

    Parameters
    ----------
    session : Session
    limits : ServerLimits
    """

    def __init__(self, session: Session, limits: ServerLimits) -> None:
        self._session, self._limits = session, limits
        self._pool = ThreadPoolExecutor(_WORKERS, "ssiam-images")
        self._camera = BrowserCamera(session, self._pool, limits)
        self._sockets: dict[ClientSocket, asyncio.Task[Any] | None] = {}
        self._newest: StepImages | None = None
        self._arrived: Step | None = None
        self._has_ended = False
        self._unlisten: list[Callable[[], None]] = []

    def __len__(self) -> int:
        return len(self._sockets)

    def open(self) -> None:
        """Start listening to the session."""
        loop = asyncio.get_running_loop()

        def on_step(step: Step) -> None:
            # A busy loop receives only the newest step.
            self._arrived = step
            call_on(loop, self._send_step)

        self._arrived = self._session.newest
        self._unlisten = [
            self._session.listen(on_step),
            self._session.listen_notes(lambda note: call_on(loop, self._send, note_message(note))),
            self._session.listen_health(
                lambda health: call_on(loop, self._send, health_message(health))
            ),
            self._session.recordings.listen(
                lambda listing: call_on(loop, self._send, recordings_message(listing))
            ),
        ]
        self._send_step()

    def close(self) -> None:
        """Stop listening to the session."""
        for unlisten in self._unlisten:
            unlisten()
        self._pool.shutdown(wait=False)

    async def end(self) -> None:
        """Disconnect all clients: the server ends."""
        self._has_ended = True
        for socket in self._sockets:
            socket.end(GOING_AWAY)
        tasks = [task for task in self._sockets.values() if task is not None]
        if tasks:
            await asyncio.wait(tasks, timeout=_DISCONNECT_TIMEOUT)

    async def serve(self, websocket: WebSocket) -> None:
        """Serve one client until it leaves; refuse it if there are too many."""
        if self._has_ended or len(self._sockets) >= self._limits.clients:
            await websocket.close()
            return
        socket = ClientSocket(websocket, self._session, self._camera, self._limits, self.__len__)
        self._sockets[socket] = asyncio.current_task()
        try:
            socket.send_hello()
            if self._session.health.state != "running":
                socket.send(health_message(self._session.health))
            socket.send(recordings_message(self._session.recordings.listing()))
            if self._newest is not None:
                socket.send_step(self._newest)
            await socket.run()
        finally:
            del self._sockets[socket]

    def _send_step(self) -> None:
        step = self._arrived
        if step is None or (self._newest is not None and self._newest.step is step):
            return
        self._newest = StepImages(step, self._pool)
        for socket in self._sockets:
            socket.send_step(self._newest)

    def _send(self, text: str) -> None:
        for socket in self._sockets:
            socket.send(text)
