"""`Service`: what a page's server needs of a session; `LiveService` is that of the live page."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Protocol

from ssiam.geometry import Image
from ssiam.web.server.incoming import Message, parse_message
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.outgoing import (
    health_message,
    hello_message,
    note_message,
    recordings_message,
)
from ssiam.web.session import Session
from ssiam.web.types import HealthState, Step


class Service(Protocol):
    """A session, its messages and its files, as the server sends them to browsers.

    All methods are safe to call from any thread, and none of them blocks.

    Attributes
    ----------
    index : str
        File of the page at ``/``.
    folder : str
        First part of the path of all files that can be downloaded.
    """

    index: str
    folder: str

    @property
    def takes_images(self) -> bool:
        """Whether frames come from a browser."""

    @property
    def newest(self) -> Step | None:
        """The last step; None before the first."""

    @property
    def state(self) -> HealthState:
        """Whether the session still works."""

    def first_texts(self, limits: ServerLimits) -> list[str]:
        """The messages to a new client, in order, before its first step."""

    def listen(
        self, on_step: Callable[[Step], None], on_text: Callable[[str], None]
    ) -> list[Callable[[], None]]:
        """Call `on_step` and `on_text` with all that follows; returns functions that end it."""

    def set_clients(self, count: int) -> None:
        """Take note of the number of clients, whenever it changes."""

    def parse(self, text: str) -> Message:
        """Parse a client's message; raises as `parse_message`."""

    def submit(self, command: Any) -> Future[Any]:
        """Queue a command that `parse` has returned; as `Session.submit`."""

    def push(self, image: Image) -> None:
        """Add a frame of a browser."""

    def file(self, path: str) -> tuple[Path, str]:
        """Path and download name of a file below `folder`; `KeyError` if there is none."""


class LiveService:
    """The live page's service.

    Parameters
    ----------
    session : Session
    """

    index = "index.html"
    folder = "recordings"

    def __init__(self, session: Session) -> None:
        self._session = session
        self.submit = session.submit
        self.push = session.push

    @property
    def takes_images(self) -> bool:
        """Whether the source is a browser's camera."""
        return self._session.info.webcam

    @property
    def newest(self) -> Step | None:
        """The last step."""
        return self._session.newest

    @property
    def state(self) -> HealthState:
        """State of the session's health."""
        return self._session.health.state

    def first_texts(self, limits: ServerLimits) -> list[str]:
        """Greeting, health unless it is good, and recordings."""
        session = self._session
        texts = [hello_message(session.info, session.limits, limits)]
        if session.health.state != "running":
            texts.append(health_message(session.health))
        return [*texts, recordings_message(session.recordings.listing())]

    def listen(
        self, on_step: Callable[[Step], None], on_text: Callable[[str], None]
    ) -> list[Callable[[], None]]:
        """Forward steps, notes, health and recordings."""
        session = self._session
        return [
            session.listen(on_step),
            session.listen_notes(lambda note: on_text(note_message(note))),
            session.listen_health(lambda health: on_text(health_message(health))),
            session.recordings.listen(lambda listing: on_text(recordings_message(listing))),
        ]

    def set_clients(self, count: int) -> None:
        """The live session does not depend on who watches it."""

    def parse(self, text: str) -> Message:
        """Parse a command of the live protocol."""
        return parse_message(text)

    def file(self, path: str) -> tuple[Path, str]:
        """A file of a recording, ``NAME/FILE``."""
        name, _, file = path.partition("/")
        return self._session.recordings.path(name, file), f"{name}-{file}"
