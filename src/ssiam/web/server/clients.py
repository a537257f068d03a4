"""`Clients`: all who watch a session through the server."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from starlette.websockets import WebSocket

from ssiam.web.errors import Note
from ssiam.web.server.announcements import health, note, recordings
from ssiam.web.server.camera import BrowserCamera
from ssiam.web.server.encoding import StepPictures
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.sockets import GOING_AWAY, ClientSocket, call_on
from ssiam.web.session import Session
from ssiam.web.step import Step

_WORKERS: Final = 2  # that make pictures
_FAREWELL: Final = 2.0  # seconds for all clients to be told that it is over


class Clients:
    """Lets clients in, and passes on to them what the session tells.

    Between `open` and `close` it is to be used on one event loop.

    Parameters
    ----------
    session : Session
    limits : ServerLimits
    """

    def __init__(self, session: Session, limits: ServerLimits) -> None:
        self._session, self._limits = session, limits
        self._pool = ThreadPoolExecutor(_WORKERS, "ssiam-pictures")
        self._camera = BrowserCamera(session, self._pool, limits)
        self._sockets: dict[ClientSocket, asyncio.Task[Any] | None] = {}
        self._newest: StepPictures | None = None
        self._arrived: Step | None = None
        self._is_over = False
        self._ends: list[Callable[[], None]] = []

    def __len__(self) -> int:
        return len(self._sockets)

    def open(self) -> None:
        """Begin to listen to the session."""
        loop = asyncio.get_running_loop()

        def arrived(step: Step) -> None:
            # Only the newest is kept for a loop that is busy.
            self._arrived = step
            call_on(loop, self._show)

        self._arrived = self._session.newest
        self._ends = [
            self._session.listen(arrived),
            self._session.notes(lambda news: call_on(loop, self._say_note, news)),
            self._session.healths(lambda news: call_on(loop, self._say, health(news))),
            self._session.recordings.listen(
                lambda listing: call_on(loop, self._say, recordings(listing))
            ),
        ]
        self._show()

    def close(self) -> None:
        """Listen no longer."""
        for end in self._ends:
            end()
        self._pool.shutdown(wait=False)

    async def end(self) -> None:
        """Send all clients away: the server ends."""
        self._is_over = True
        for socket in self._sockets:
            socket.end(GOING_AWAY)
        tasks = [task for task in self._sockets.values() if task is not None]
        if tasks:
            await asyncio.wait(tasks, timeout=_FAREWELL)

    async def serve(self, websocket: WebSocket) -> None:
        """Serve one client until it leaves; refuse it if there are too many."""
        if self._is_over or len(self._sockets) >= self._limits.clients:
            await websocket.close()
            return
        socket = ClientSocket(websocket, self._session, self._camera, self._limits, self.__len__)
        self._sockets[socket] = asyncio.current_task()
        try:
            socket.greet()
            if self._session.health.state != "running":
                socket.say(health(self._session.health))
            socket.say(recordings(self._session.recordings.listing()))
            if self._newest is not None:
                socket.show(self._newest)
            await socket.run()
        finally:
            del self._sockets[socket]

    def _show(self) -> None:
        step = self._arrived
        if step is None or (self._newest is not None and self._newest.step is step):
            return
        self._newest = StepPictures(step, self._pool)
        for socket in self._sockets:
            socket.show(self._newest)

    def _say_note(self, news: Note) -> None:
        self._say(note(news))

    def _say(self, text: str) -> None:
        for socket in self._sockets:
            socket.say(text)
