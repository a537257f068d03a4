"""`BrowserCamera`: pictures of a browser's camera on their way to the session."""

from __future__ import annotations

import asyncio
from concurrent.futures import Executor

from ssiam.web.errors import CommandError
from ssiam.web.feeds.pictures import decode_picture
from ssiam.web.server.limits import ServerLimits
from ssiam.web.session import Session


class BrowserCamera:
    """Takes the pictures of one client at a time; to be used on one event loop.

    Parameters
    ----------
    session : Session
    pool : Executor
        Decodes.
    limits : ServerLimits
    """

    def __init__(self, session: Session, pool: Executor, limits: ServerLimits) -> None:
        self._session, self._pool, self._limits = session, pool, limits
        self._owner: object = None
        self._decoding: asyncio.Future[None] | None = None

    def take(self, client: object, jpeg: bytes) -> asyncio.Future[None] | None:
        """Hand a picture on; it is left out (None) while the one before is being decoded.

        What is returned raises `SsiamError` if the picture cannot be used.

        Raises
        ------
        CommandError
            Another client's camera is the source.
        """
        self._owner = self._owner or client
        if self._owner is not client:
            raise CommandError("not-possible", "another browser's camera is the source already")
        if self._decoding is not None and not self._decoding.done():
            return None
        loop = asyncio.get_running_loop()
        self._decoding = loop.run_in_executor(self._pool, self._push, jpeg)
        return self._decoding

    def release(self, client: object) -> None:
        """The client has left: another one's camera may be the source."""
        if self._owner is client:
            self._owner = None

    def _push(self, jpeg: bytes) -> None:
        self._session.push(decode_picture(jpeg, self._limits.picture_pixels))
