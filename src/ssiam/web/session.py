"""`Session`: a live source, its targets, and whoever watches them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final, Literal

from ssiam.copying import NotCopied
from ssiam.errors import SsiamError
from ssiam.geometry import Image
from ssiam.trackers import SteadiedTracker
from ssiam.web.commands import Command, Hold
from ssiam.web.errors import Note
from ssiam.web.feeds.feed import Feed, open_feed
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.following import Following
from ssiam.web.info import SessionInfo, SessionLimits
from ssiam.web.recording import Recordings
from ssiam.web.rota import Rota
from ssiam.web.step import Step
from ssiam.web.targets import Targets

_WAIT: Final = 0.02  # seconds for a frame, before commands are looked at again


class Session(NotCopied):
    """Tracks on a thread of its own; everybody else asks and listens. A context manager.

    Threads: its methods may be called from any; what they ask for is done in the one that tracks.

    Parameters
    ----------
    feed : Feed
        Where frames come from; closed with the session.
    tracker : SteadiedTracker
        The targets' trackers are made from it.
    name : str
        The tracker's.
    recordings : Recordings
        Closed with the session.
    news : Rota of Note, optional
        What the feed's notes are told to.
    limits : SessionLimits, optional
    """

    def __init__(
        self,
        feed: Feed,
        tracker: SteadiedTracker,
        name: str,
        recordings: Recordings,
        news: Rota[Note] | None = None,
        limits: SessionLimits | None = None,
    ) -> None:
        self.limits = limits or SessionLimits()
        self.recordings = recordings
        self._feed, self._name = feed, name
        targets = Targets(tracker, self.limits.targets)
        self._news = Rota[Note]() if news is None else news
        self._following = Following(feed, targets, recordings, self._news.tell)
        self._steps: Rota[Step] = Rota()
        self._asked: SimpleQueue[tuple[Command, Future[Any]]] = SimpleQueue()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ssiam-session", daemon=True)

    @classmethod
    def open(
        cls,
        source: str,
        tracker: SteadiedTracker,
        *,
        name: str = "tracker",
        pace: Literal["clock", "fast"] = "clock",
        recordings: Path | None = None,
    ) -> Session:
        """A session on a source, not started yet.

        Parameters
        ----------
        source : str
        pace : {"clock", "fast"}
            Both as `open_feed` takes them, which tells the errors.
        tracker : SteadiedTracker
        name : str
            The tracker's, for people.
        recordings : Path, optional
            Folder that keeps them.
        """
        news: Rota[Note] = Rota()
        feed = open_feed(source, pace=pace, notes=news.tell)
        try:
            return cls(feed, tracker, name, Recordings(recordings), news)
        except SsiamError:
            feed.close()
            raise

    @property
    def info(self) -> SessionInfo:
        """What is known of the source and the tracker."""
        feed, is_webcam = self._feed, isinstance(self._feed, PushedFeed)
        return SessionInfo(
            feed.name, feed.size_wh, feed.fps, feed.length, self._name, feed.seekable, is_webcam
        )

    @property
    def newest(self) -> Step | None:
        """The last step; None before the first frame."""
        return self._following.newest

    def submit(self, command: Command) -> Future[Any]:
        """Ask for something; the answer, or the `SsiamError` why not, comes between two frames."""
        answer: Future[Any] = Future()
        self._asked.put((command, answer))
        return answer

    def listen(self, listener: Callable[[Step], object]) -> Callable[[], None]:
        """Call `listener` after each step, on the session's thread; what is returned ends it."""
        return self._steps.add(listener)

    def notes(self, listener: Callable[[Note], None]) -> Callable[[], None]:
        """Call `listener` with each message for people; what is returned ends it."""
        return self._news.add(listener)

    def push(self, picture: Image) -> None:
        """Give a browser's picture (H, W, 3) uint8 BGR to a session that waits for them."""
        if isinstance(self._feed, PushedFeed):
            self._feed.push(picture)

    def start(self) -> None:
        """Begin; to be called once."""
        self._thread.start()

    def close(self) -> None:
        """End everything. May be called twice."""
        self._closing.set()
        self._feed.close()
        if self._thread.is_alive():
            self._thread.join()
        self.recordings.close()

    def __enter__(self) -> Session:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _run(self) -> None:
        while not self._closing.is_set():
            self._answer()
            arrival = self._feed.take(_WAIT)
            if arrival is not None:
                self._steps.tell(self._following.see(arrival))
            elif self.newest is not None and self._following.playing != self.newest.playing:
                self._tell_again()

    def _answer(self) -> None:
        """Carry out what has been asked for."""
        while True:
            try:
                command, answer = self._asked.get_nowait()
            except Empty:
                return
            if not answer.set_running_or_notify_cancel():
                continue
            try:
                result = self._following.carry_out(command)
            except SsiamError as error:
                answer.set_exception(error)
                continue
            answer.set_result(result)
            if not isinstance(command, Hold):
                self._tell_again()

    def _tell_again(self) -> None:
        step = self._following.again()
        if step is not None:
            self._steps.tell(step)
