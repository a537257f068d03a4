"""`Session`: a live source, its targets, and whoever watches them."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final, Literal

from ssiam.copying import NotCopied
from ssiam.errors import SsiamError, one_line
from ssiam.geometry import Image
from ssiam.trackers import StabilizedTracker
from ssiam.web.commands import Command, Hold
from ssiam.web.errors import CommandError, Health, Note
from ssiam.web.feeds.feed import Feed, open_feed
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.following import Following
from ssiam.web.info import SessionInfo, SessionLimits
from ssiam.web.recording import Recordings
from ssiam.web.rota import Rota
from ssiam.web.step import Step
from ssiam.web.targets import Targets
from ssiam.web.troubles import Troubles
from ssiam.web.watchdog import Watchdog

_log = logging.getLogger(__name__)

_WAIT: Final = 0.02  # seconds for a frame, before commands are looked at again
_CLOSING: Final = 5.0  # seconds that `close` waits for a frame or a command under way


class Session(NotCopied):
    """Tracks on a thread of its own; everybody else asks and listens. A context manager.

    Threads: its methods may be called from any; what they ask for is done in the one that tracks.

    An error in a frame or in a command is reported, and the session goes on. A frame or a command
    that does not end is reported too (`health`); it cannot be interrupted, and everything that is
    asked meanwhile is refused.

    Parameters
    ----------
    feed : Feed
        Where frames come from; closed with the session.
    tracker : StabilizedTracker
        The targets' trackers are made from it.
    name : str
        The tracker's.
    recordings : Recordings
        Closed with the session.
    news : Rota of Note, optional
        What the feed's notes are told to.
    limits : SessionLimits, optional
    patience : float
        Seconds after which a frame or a command counts as one that does not come to an end.
    """

    def __init__(
        self,
        feed: Feed,
        tracker: StabilizedTracker,
        name: str,
        recordings: Recordings,
        news: Rota[Note] | None = None,
        limits: SessionLimits | None = None,
        patience: float = 10.0,
    ) -> None:
        self.limits = limits or SessionLimits()
        self.recordings = recordings
        self._feed, self._name = feed, name
        self._news = Rota[Note]() if news is None else news
        self._troubles = Troubles(self._news.tell)
        targets = Targets(tracker, self.limits.targets, self._troubles.tell)
        self._following = Following(feed, targets, recordings, self._troubles, self._news.tell)
        recordings.notes(self._news.tell)
        self._steps: Rota[Step] = Rota()
        self._health, self._healths = Health(), Rota[Health]()
        self._watchdog = Watchdog(patience, self._stalled, self._recovered)
        self._asked: SimpleQueue[tuple[Command, Future[Any]]] = SimpleQueue()
        self._under_way: Future[Any] | None = None  # answer to the command that is carried out
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ssiam-session", daemon=True)

    @classmethod
    def open(
        cls,
        source: str,
        tracker: StabilizedTracker,
        *,
        name: str = "tracker",
        pace: Literal["clock", "fast"] = "clock",
        recordings: Path | None = None,
        stream: int | None = None,
        levels: tuple[float, float] | None = None,
    ) -> Session:
        """A session on a source, not started yet.

        Parameters
        ----------
        source : str
        pace : {"clock", "fast"}
            Both as `open_feed` takes them, which tells the errors.
        tracker : StabilizedTracker
        name : str
            The tracker's, for people.
        recordings : Path, optional
            Folder that keeps them.
        stream : int, optional
        levels : (low, high), optional
            Both as `ssiam.video.open_source` takes them.
        """
        news: Rota[Note] = Rota()
        feed = open_feed(source, pace=pace, notes=news.tell, stream=stream, levels=levels)
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

    @property
    def health(self) -> Health:
        """Whether the targets are still tracked."""
        return self._health

    def submit(self, command: Command) -> Future[Any]:
        """Ask for something; the answer, or the `SsiamError` why not, comes between two frames."""
        answer: Future[Any] = Future()
        self._asked.put((command, answer))
        if self._closing.is_set() or self._health.state != "running":
            self._refuse_waiting()
        return answer

    def listen(self, listener: Callable[[Step], object]) -> Callable[[], None]:
        """Call `listener` after each step, on the session's thread; what is returned ends it."""
        return self._steps.add(listener)

    def notes(self, listener: Callable[[Note], None]) -> Callable[[], None]:
        """Call `listener` with each message for people; what is returned ends it."""
        return self._news.add(listener)

    def say(self, note: Note) -> None:
        """Tell a message to everybody who listens to `notes`."""
        self._news.tell(note)

    def healths(self, listener: Callable[[Health], None]) -> Callable[[], None]:
        """Call `listener` whenever `health` changes; what is returned ends it."""
        return self._healths.add(listener)

    def push(self, picture: Image) -> None:
        """Give a browser's picture (H, W, 3) uint8 BGR to a session that waits for them."""
        if isinstance(self._feed, PushedFeed):
            self._feed.push(picture)

    def start(self) -> None:
        """Begin; to be called once."""
        self._watchdog.start()
        self._thread.start()

    def close(self) -> None:
        """End everything. May be called twice.

        A frame or a command that does not come to an end is waited for a few seconds, and then
        left alone: its thread lasts as long as the process, and `stuck` is True.
        """
        self._closing.set()
        self._feed.close()
        if self._thread.is_alive():
            self._thread.join(_CLOSING)
        self._watchdog.close()
        self._refuse_waiting()
        self.recordings.close()

    @property
    def stuck(self) -> bool:
        """Whether the session was closed, and its thread still works on a frame or a command."""
        return self._closing.is_set() and self._thread.is_alive()

    def __enter__(self) -> Session:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._answer()
                self._go_on()
        except BaseException as error:
            # Nothing that is raised may end this thread without a word.
            self._die(error)

    def _go_on(self) -> None:
        """Take a frame, if one comes."""
        arrival = self._feed.take(_WAIT)
        if arrival is not None:
            with self._watchdog.over(f"frame {arrival.frame.index}"):
                self._steps.tell(self._following.see(arrival))
        elif self.newest is not None and self._following.playing != self.newest.playing:
            self._tell_again()

    def _answer(self) -> None:
        """Carry out what has been asked for."""
        while not self._closing.is_set():
            try:
                command, answer = self._asked.get_nowait()
            except Empty:
                return
            if not answer.set_running_or_notify_cancel():
                continue
            name = type(command).__name__.lower()
            self._under_way = answer
            try:
                with self._watchdog.over(f"the command {name}"):
                    result = self._following.carry_out(command)
            except SsiamError as error:
                _settle(answer, error=error)
            except Exception as error:
                text = self._troubles.tell(f"the command {name}", error)
                _settle(answer, error=CommandError("failed", f"{name} has failed: {text}"))
            else:
                _settle(answer, result)
                if not isinstance(command, Hold):
                    self._tell_again()
            self._under_way = None

    def _tell_again(self) -> None:
        step = self._following.again()
        if step is not None:
            self._steps.tell(step)

    def _stalled(self, work: str) -> None:
        """Some work takes so long that it may never end; on the watchdog's thread."""
        text = (
            f"Tracking stands still: {work} has not come to an end. Nothing is tracked until it "
            "does; if it never does, end ssiam (Ctrl-C) and start it again with another tracker "
            "or box"
        )
        _log.info("%s", text)
        self._become(Health("stalled", text))
        answer = self._under_way
        if answer is not None:
            _settle(answer, error=CommandError("failed", text))
        self._refuse_waiting()

    def _recovered(self, work: str, seconds: float) -> None:
        """It has ended after all; on the session's thread."""
        text = f"Tracking goes on: {work} took {seconds:.0f} s"
        _log.info("%s", text)
        self._become(Health())
        self._news.tell(Note("info", text))

    def _die(self, error: BaseException) -> None:
        text = f"Tracking has ended because of an error in ssiam: {one_line(error)}"
        _log.critical("%s", text, exc_info=error)
        self._become(Health("failed", text))
        if self._under_way is not None:
            _settle(self._under_way, error=CommandError("failed", text))
        self._refuse_waiting()

    def _become(self, health: Health) -> None:
        self._health = health
        self._healths.tell(health)

    def _refuse_waiting(self) -> None:
        """Answer everything that waits: it will not be carried out, or nobody knows when."""
        text = self._health.message or "the session has ended"
        with suppress(Empty):
            while True:
                _, answer = self._asked.get_nowait()
                if answer.set_running_or_notify_cancel():
                    _settle(answer, error=CommandError("not-possible", text))


def _settle(answer: Future[Any], result: object = None, *, error: SsiamError | None = None) -> None:
    """Answer, unless the watchdog has done so already."""
    with suppress(InvalidStateError):
        if error is None:
            answer.set_result(result)
        else:
            answer.set_exception(error)
