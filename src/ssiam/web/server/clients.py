"""`Clients`: all clients of a service."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from starlette.websockets import WebSocket

from ssiam.web.server.images import BrowserCamera, StepImages
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.service import Service
from ssiam.web.server.sockets import GOING_AWAY, ClientSocket, call_on
from ssiam.web.types import Step

_WORKERS: Final = 2  # threads that encode and decode images
_DISCONNECT_TIMEOUT: Final = 2.0  # seconds for all clients to disconnect when the server ends


class Clients:
    """Accepts clients, and forwards the service's steps and messages to them.

    To be used on one event loop, between `open` and `close`.

    Parameters
    ----------
    service : Service
    limits : ServerLimits
    """

    def __init__(self, service: Service, limits: ServerLimits) -> None:
        self._service, self._limits = service, limits
        self._pool = ThreadPoolExecutor(_WORKERS, "ssiam-images")
        self._camera = BrowserCamera(service, self._pool, limits)
        self._sockets: dict[ClientSocket, asyncio.Task[Any] | None] = {}
        self._newest: StepImages | None = None
        self._arrived: Step | None = None
        self._has_ended = False
        self._unlisten: list[Callable[[], None]] = []

    def __len__(self) -> int:
        return len(self._sockets)

    def open(self) -> None:
        """Start listening to the service."""
        loop = asyncio.get_running_loop()

        def on_step(step: Step) -> None:
            # A busy loop receives only the newest step.
            self._arrived = step
            call_on(loop, self._send_step)

        self._arrived = self._service.newest
        self._unlisten = self._service.listen(on_step, lambda text: call_on(loop, self._send, text))
        self._send_step()

    def close(self) -> None:
        """Stop listening to the service."""
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
        socket = ClientSocket(websocket, self._service, self._camera, self._limits, self.__len__)
        self._sockets[socket] = asyncio.current_task()
        self._service.set_clients(len(self._sockets))
        try:
            for text in self._service.first_texts(self._limits):
                socket.send(text)
            if self._newest is not None:
                socket.send_step(self._newest)
            await socket.run()
        finally:
            del self._sockets[socket]
            self._service.set_clients(len(self._sockets))

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
