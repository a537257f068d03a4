"""`ssiam track` without ``--box``: the targets are chosen on a page in the browser."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from ssiam.addresses import display_name, is_address
from ssiam.cli.moments import PlannedTarget
from ssiam.cli.track_progress import RunProgress
from ssiam.cli.track_run import TrackJob
from ssiam.errors import ArgumentError, MissingExtraError, SsiamError
from ssiam.video import Frame
from ssiam.video.sources import STDIN, camera_index

if TYPE_CHECKING:
    from ssiam.web.picking.page import PickPage

_OTHER_WAYS = (
    "--pick proposes targets in the first frame, and --box x,y,width,height gives one, in pixels"
)


Run: TypeAlias = Callable[[TrackJob, Sequence[PlannedTarget], Sequence[RunProgress]], None]
"""`run_track` or `run_backward`."""


def choose_and_track(job_for: Callable[[int], TrackJob], run: Run, progress: RunProgress) -> None:
    """Let a person choose the targets on a page, track them, and show there what was written.

    Parameters
    ----------
    job_for : callable
        The job for a number of targets.
    run : callable
    progress : RunProgress
        Of the terminal.

    Raises
    ------
    SsiamError
        The page is not possible here, or was closed; else as `run`.
    """
    job = job_for(1)
    source = job.source.spec
    _check_readable_twice(source)
    try:
        from ssiam.web.picking.page import PickPage, open_in_browser
    except MissingExtraError as error:
        raise MissingExtraError(f"{error}; without it, {_OTHER_WAYS}") from error

    start = job.span.start

    def is_selectable(frame: Frame) -> bool:
        return start is None or start.is_reached(frame)

    tracker = job.tracker.load(job.config)
    with PickPage(
        job.source.open, tracker, name=job.tracker.tracker, is_selectable=is_selectable
    ) as page:
        is_opened = open_in_browser(page.address)
        if not is_opened and not sys.stderr.isatty():
            raise ArgumentError(
                f"{display_name(source)}: no target is given, and no browser: {_OTHER_WAYS}"
            )
        print(f"ssiam: choose the targets at {page.address} (Ctrl-C ends)", file=sys.stderr)
        if "SSH_CONNECTION" in os.environ and not is_opened:
            port = page.port
            print(
                f"ssiam: from your own machine, first: ssh -L {port}:127.0.0.1:{port} HOST",
                file=sys.stderr,
            )
        targets = [PlannedTarget.from_start(each) for each in page.wait_for_targets()]
        shown = _PageProgress(page)
        try:
            run(job_for(len(targets)), targets, [progress, shown])
        except SsiamError as failure:
            page.finish(shown.written, [str(failure)])
            page.wait_until_done()
            raise
        page.finish(shown.written, [f"in {Path.cwd()}"])
        page.wait_until_done()


class _PageProgress:
    """Shows the progress of a run on the page."""

    def __init__(self, page: PickPage) -> None:
        self._page = page
        self.written: Sequence[tuple[str, Path]] = ()

    def advance(self, done: int, total: int | None, fps: float | None) -> None:
        """Move the page's bar."""
        self._page.report(done, total, fps)

    def finished(self, written: Sequence[tuple[str, Path]]) -> None:
        """Keep what was written, for the page's list."""
        self.written = written


def _check_readable_twice(source: str) -> None:
    """Raise `ArgumentError` for a source that the page would use up."""
    if source == STDIN:
        raise ArgumentError(f"standard input can be read only once: {_OTHER_WAYS}")
    is_live = camera_index(source) is not None
    if is_live or (is_address(source) and not source.lower().startswith("file://")):
        raise ArgumentError(
            f"no target is given: ssiam live shows a camera or a stream on a page; "
            f"here, {_OTHER_WAYS}"
        )
