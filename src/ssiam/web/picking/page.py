"""`PickPage`: the page on which targets are chosen, and the run that follows is watched."""

from __future__ import annotations

import os
import sys
import threading
import time
import webbrowser
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from ssiam.copying import NotCopyable
from ssiam.errors import IncompleteError, SsiamError
from ssiam.exchange.annotations import Annotation
from ssiam.exchange.blending import Keyframe
from ssiam.exchange.result_files import read_annotations
from ssiam.trackers import StabilizedTracker
from ssiam.video import Frame, Source
from ssiam.web.picking.commands import Progress, WrittenFile
from ssiam.web.picking.proposals import BoxProposer
from ssiam.web.picking.service import PickService
from ssiam.web.picking.session import PickSession, Propose
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.serving import PageServer

_CHECK_INTERVAL: Final = 0.1  # seconds between two checks of a wait, which Ctrl-C interrupts
_REPORT_INTERVAL: Final = 0.1  # seconds between two reports, at least
_PICKING_GRACE: Final = 60.0  # seconds for which the page may be closed before targets are chosen
_WRITTEN_GRACE: Final = 5.0  # the same afterwards; a reload of the page takes less


class PageClosedError(SsiamError):
    """The page was closed before targets were chosen."""


class PickPage(NotCopyable):
    """Serves the page in which the targets of a clip are chosen. A context manager.

    Threads: for one thread, the one that tracks. The session and the server have their own
    (`ssiam.web.picking.session`); all waiting can be interrupted by Ctrl-C.

    Parameters
    ----------
    open_frames : callable
        Opens the source at its first frame; called again for frames before the current one, and
        on another thread.
    tracker : StabilizedTracker
        Prototype of the trackers of a preview; not changed.
    name : str
        Name of the tracker.
    host, port
        As in `PageServer`; by default a free port of the loopback.
    needs_token : bool
        As in `PageServer`: whoever opens the page could write files.
    is_selectable : callable
        Whether a target may have a box in a frame: not outside of the part that is tracked.
    no_keyframes : str, optional
        Why a target can have a box in one frame only; shown if a second one is given.
    no_second_run : str, optional
        Why the targets cannot be corrected after all was written; shown if a person wants to.
    propose : callable, optional
        From an image and a point to a box; by default a `BoxProposer`.
    limits : ServerLimits, optional
    grace : (float, float)
        Seconds for which no page may be open before the targets are chosen, and after all is
        written.

    Raises
    ------
    SsiamError
        The source cannot be opened, or the server cannot listen.
    """

    def __init__(
        self,
        open_frames: Callable[[], Source],
        tracker: StabilizedTracker,
        *,
        name: str = "tracker",
        host: str = "127.0.0.1",
        port: int = 0,
        needs_token: bool = True,
        is_selectable: Callable[[Frame], bool] = lambda frame: True,
        no_keyframes: str | None = None,
        no_second_run: str | None = None,
        propose: Propose | None = None,
        limits: ServerLimits | None = None,
        grace: tuple[float, float] = (_PICKING_GRACE, _WRITTEN_GRACE),
    ) -> None:
        propose = BoxProposer().propose if propose is None else propose
        self._session = PickSession(
            open_frames, tracker, name, propose, is_selectable, no_keyframes, no_second_run
        )
        self._service = PickService(self._session, self._on_clients)
        self._server = PageServer(self._service, host, port, needs_token=needs_token, limits=limits)
        self._grace = grace
        self._reported_at = 0.0
        self._clients = 0
        self._alone_since: float | None = None  # None before the first visit

    @property
    def address(self) -> str:
        """What to open in a browser, with the token."""
        return self._server.address

    @property
    def port(self) -> int:
        """Port of the page."""
        return self._server.access.port

    def __enter__(self) -> PickPage:
        self._session.start()
        try:
            self._server.start()
        except BaseException:
            self._session.close()
            raise
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect the page. May be called twice."""
        self._session.close()
        self._server.close()

    @property
    def first_index(self) -> int:
        """The first frame of the part that is tracked, once targets are chosen."""
        return self._session.first_index

    def wait_for_targets(self) -> list[tuple[Keyframe, ...]]:
        """Wait until the person has chosen; the keyframes of each target.

        Targets are in the order of their numbers, keyframes in that of the frames. Each target has
        a box in one at least, and begins in the first of these.

        Raises
        ------
        PageClosedError
            The page was closed, and not opened again within the time of grace.
        IncompleteError
            The server has ended by itself.
        """
        self._wait(self._session.chosen, self._grace[0])
        if not self._session.chosen.is_set():
            raise PageClosedError("the page was closed before targets were chosen; nothing written")
        return self._session.keyframes()

    def report(self, done: int, total: int | None, fps: float | None) -> None:
        """Show how many frames are done; calls that follow too fast are ignored."""
        now = time.monotonic()
        if now - self._reported_at >= _REPORT_INTERVAL or done == total:
            self._reported_at = now
            self._session.report(Progress(done, total, fps))

    def finish(self, paths: Sequence[tuple[str, Path]], notes: Sequence[str] = ()) -> None:
        """Show what was written.

        Parameters
        ----------
        paths : sequence of (str, Path)
            Kind ("video", ...) and path of each file. Missing ones are left out. The boxes of
            results in .csv or .jsonl are a guide for corrections.
        notes : sequence of str
            Further lines, such as the summary.
        """
        found = [(kind, path.resolve()) for kind, path in paths if path.is_file()]
        self._service.files = {path.name: path for _, path in found}
        files = tuple(WrittenFile(kind, path.name, path.stat().st_size) for kind, path in found)
        self._session.finish(files, tuple(notes), self._rows(found))

    def _rows(self, found: Sequence[tuple[str, Path]]) -> tuple[Annotation, ...]:
        """The boxes of the results; none if these are of another kind."""
        for kind, path in found:
            if kind == "results" and path.suffix in (".csv", ".jsonl"):
                with suppress(SsiamError):
                    return read_annotations(path, self._session.size_wh, self._session.fps).rows
        return ()

    def wait_until_done(self) -> bool:
        """Wait until the person is done with the results, or has closed the page.

        Returns
        -------
        bool
            Whether the person corrects the targets now: `wait_for_targets` follows.
        """
        if self._alone_since is None and not self._clients:
            return False
        self._wait(self._session.seen, self._grace[1])
        is_again = self._session.seen.is_set() and self._session.state.phase != "written"
        self._session.seen.clear()
        return is_again

    def _wait(self, event: threading.Event, grace: float) -> None:
        """Wait for an event, or until nobody has watched for `grace` seconds."""
        while not event.wait(_CHECK_INTERVAL):
            alone_since = self._alone_since
            if alone_since is not None and time.monotonic() - alone_since > grace:
                return
            if self._server.has_ended:
                raise IncompleteError(f"{self._server.url}: the server has ended; see the log")

    def _on_clients(self, count: int) -> None:
        """Called on the server's thread."""
        self._clients = count
        self._alone_since = None if count else time.monotonic()


def open_in_browser(address: str) -> bool:
    """Open an address in this machine's browser; False over ssh, where there is none to see.

    Nothing is opened either where the system has no display, or no browser.
    """
    is_remote = "SSH_CONNECTION" in os.environ or "SSH_TTY" in os.environ
    has_display = "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    if not has_display and (is_remote or sys.platform.startswith("linux")):
        return False
    try:
        return webbrowser.open(address)
    except webbrowser.Error:
        return False
