"""`Session`: tracks targets in a live source, and serves the clients that control it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from ssiam.copying import NotCopyable
from ssiam.errors import SsiamError, one_line
from ssiam.geometry import Image
from ssiam.trackers import StabilizedTracker
from ssiam.web.engine import Engine
from ssiam.web.events import Listeners
from ssiam.web.feeds.base import Feed
from ssiam.web.feeds.opening import Pace, open_feed
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.monitoring import ErrorReporter, Watchdog
from ssiam.web.recording import Recordings
from ssiam.web.targets import Targets
from ssiam.web.types import (
    Command,
    CommandError,
    Health,
    Hold,
    Note,
    SessionInfo,
    SessionLimits,
    Step,
)

_log = logging.getLogger(__name__)

_FRAME_TIMEOUT: Final = 0.02  # seconds to wait for a frame before commands are processed
_CLOSE_TIMEOUT: Final = 5.0  # seconds that `close` waits for the current frame or command


class Session(NotCopyable):
    """Tracks on its own thread; clients submit commands and listen to steps. A context manager.

    Threads: all methods are safe to call from any thread. Commands are executed on the session's.

    An error in a frame or in a command is reported, and the session continues. A frame or a
    command that exceeds `stall_seconds` is reported too (`health`). It cannot be interrupted, and
    all commands are refused until it finishes.

    Parameters
    ----------
    feed : Feed
        Source of the frames; closed with the session.
    tracker : StabilizedTracker
        Prototype of the targets' trackers.
    name : str
        Name of the tracker.
    recordings : Recordings
        Closed with the session.
    notes : Listeners of Note, optional
        Listeners that the feed notifies too.
    limits : SessionLimits, optional
    stall_seconds : float
        Duration after which a frame or a command counts as stalled.
    """

    def __init__(
        self,
        feed: Feed,
        tracker: StabilizedTracker,
        name: str,
        recordings: Recordings,
        notes: Listeners[Note] | None = None,
        limits: SessionLimits | None = None,
        stall_seconds: float = 10.0,
    ) -> None:
        self.limits = limits or SessionLimits()
        self.recordings = recordings
        self._feed, self._name = feed, name
        self._notes = Listeners[Note]() if notes is None else notes
        self._errors = ErrorReporter(self._notes.notify)
        targets = Targets(tracker, self.limits.targets, self._errors.report)
        self._engine = Engine(feed, targets, recordings, self._errors, self._notes.notify)
        recordings.listen_notes(self._notes.notify)
        self._steps: Listeners[Step] = Listeners()
        self._health, self._health_changes = Health(), Listeners[Health]()
        self._watchdog = Watchdog(stall_seconds, self._on_stalled, self._on_recovered)
        self._commands: SimpleQueue[tuple[Command, Future[Any]]] = SimpleQueue()
        self._current: Future[Any] | None = None  # of the command that is being executed
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ssiam-session", daemon=True)

    @classmethod
    def open(
        cls,
        source: str,
        tracker: StabilizedTracker,
        *,
        name: str = "tracker",
        pace: Pace = "clock",
        recordings: Path | None = None,
        stream: int | None = None,
        levels: tuple[float, float] | None = None,
        paused: bool = False,
    ) -> Session:
        """A session on a source, not started yet.

        Parameters
        ----------
        source : str
            See `open_feed`, which also lists the errors.
        tracker : StabilizedTracker
        name : str
            Name of the tracker, for messages and the page.
        pace : {"clock", "fast"}
            See `open_feed`.
        recordings : Path, optional
            Folder for recordings; without it they are deleted with the session.
        stream, levels
            As in `ssiam.video.open_source`.
        paused : bool
            Whether a file begins paused on its first frame.
        """
        notes: Listeners[Note] = Listeners()
        feed = open_feed(
            source, pace=pace, notify=notes.notify, stream=stream, levels=levels, paused=paused
        )
        try:
            return cls(feed, tracker, name, Recordings(recordings), notes)
        except SsiamError:
            feed.close()
            raise

    @property
    def info(self) -> SessionInfo:
        """Source and tracker; size and rate may become known later."""
        feed, is_webcam = self._feed, isinstance(self._feed, PushedFeed)
        return SessionInfo(
            feed.name,
            feed.size_wh,
            feed.fps,
            feed.length,
            self._name,
            feed.seekable,
            is_webcam,
            feed.pixel_aspect,
        )

    @property
    def newest(self) -> Step | None:
        """The last step; None before the first frame."""
        return self._engine.newest

    @property
    def health(self) -> Health:
        """Whether the targets are still tracked."""
        return self._health

    def submit(self, command: Command) -> Future[Any]:
        """Queue a command for execution between two frames.

        Returns
        -------
        Future
            Has the result, or the `SsiamError` with the reason of the refusal.
        """
        answer: Future[Any] = Future()
        self._commands.put((command, answer))
        if self._closing.is_set() or self._health.state != "running":
            self._refuse_queued()
        return answer

    def listen(self, listener: Callable[[Step], object]) -> Callable[[], None]:
        """Call `listener` after each step, on the session's thread.

        Returns
        -------
        callable
            Removes the listener.
        """
        return self._steps.add(listener)

    def listen_notes(self, listener: Callable[[Note], None]) -> Callable[[], None]:
        """Call `listener` with each note; return a function that removes it."""
        return self._notes.add(listener)

    def listen_health(self, listener: Callable[[Health], None]) -> Callable[[], None]:
        """Call `listener` whenever `health` changes; return a function that removes it."""
        return self._health_changes.add(listener)

    def notify(self, note: Note) -> None:
        """Send a note to all listeners of notes."""
        self._notes.notify(note)

    def push(self, image: Image) -> None:
        """Add a frame (H, W, 3) uint8 BGR of a browser; ignored if that is not the source."""
        if isinstance(self._feed, PushedFeed):
            self._feed.push(image)

    def start(self) -> None:
        """Start tracking. May be called once."""
        self._watchdog.start()
        self._thread.start()

    def close(self) -> None:
        """Stop tracking, and close the feed and the recordings. May be called twice.

        A frame or a command that does not finish within a few seconds is abandoned: its thread
        runs until the process ends, and `stuck` is True.
        """
        self._closing.set()
        self._feed.close()
        if self._thread.is_alive():
            self._thread.join(_CLOSE_TIMEOUT)
        self._watchdog.close()
        self._refuse_queued()
        self.recordings.close()

    @property
    def stuck(self) -> bool:
        """Whether the session was closed, but its thread still processes a frame or a command."""
        return self._closing.is_set() and self._thread.is_alive()

    def __enter__(self) -> Session:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._execute_commands()
                self._process_frame()
        except BaseException as error:
            # Clients must be informed whatever ends this thread.
            self._fail(error)

    def _process_frame(self) -> None:
        arrival = self._feed.take(_FRAME_TIMEOUT)
        if arrival is not None:
            with self._watchdog.watch(f"frame {arrival.frame.index}"):
                self._steps.notify(self._engine.process(arrival))
        elif self.newest is not None and self._engine.playback != self.newest.playback:
            self._repeat_step()

    def _execute_commands(self) -> None:
        while not self._closing.is_set():
            try:
                command, answer = self._commands.get_nowait()
            except Empty:
                return
            if not answer.set_running_or_notify_cancel():
                continue
            name = type(command).__name__.lower()
            self._current = answer
            try:
                with self._watchdog.watch(f"the command {name}"):
                    result = self._engine.execute(command)
            except SsiamError as error:
                _settle(answer, error=error)
            except Exception as error:
                text = self._errors.report(f"the command {name}", error)
                _settle(answer, error=CommandError("failed", f"{name} failed: {text}"))
            else:
                _settle(answer, result)
                if not isinstance(command, Hold):
                    self._repeat_step()
            self._current = None

    def _repeat_step(self) -> None:
        step = self._engine.repeat()
        if step is not None:
            self._steps.notify(step)

    def _on_stalled(self, task: str) -> None:
        """Called on the watchdog's thread."""
        text = (
            f"Tracking has stalled: {task} has not finished. Nothing is tracked until it does. "
            "If it never does, stop ssiam (Ctrl-C) and start it again with another tracker or box"
        )
        _log.info("%s", text)
        self._set_health(Health("stalled", text))
        answer = self._current
        if answer is not None:
            _settle(answer, error=CommandError("failed", text))
        self._refuse_queued()

    def _on_recovered(self, task: str, seconds: float) -> None:
        """Called on the session's thread."""
        text = f"Tracking continues: {task} took {seconds:.0f} s"
        _log.info("%s", text)
        self._set_health(Health())
        self._notes.notify(Note("info", text))

    def _fail(self, error: BaseException) -> None:
        text = f"Tracking has ended because of an error in ssiam: {one_line(error)}"
        _log.critical("%s", text, exc_info=error)
        self._set_health(Health("failed", text))
        if self._current is not None:
            _settle(self._current, error=CommandError("failed", text))
        self._refuse_queued()

    def _set_health(self, health: Health) -> None:
        self._health = health
        self._health_changes.notify(health)

    def _refuse_queued(self) -> None:
        """Refuse all queued commands."""
        text = self._health.message or "the session has ended"
        with suppress(Empty):
            while True:
                _, answer = self._commands.get_nowait()
                if answer.set_running_or_notify_cancel():
                    _settle(answer, error=CommandError("not-possible", text))


def _settle(answer: Future[Any], result: object = None, *, error: SsiamError | None = None) -> None:
    """Resolve a future, unless the watchdog has done so already."""
    with suppress(InvalidStateError):
        if error is None:
            answer.set_result(result)
        else:
            answer.set_exception(error)
