"""`ssiam track` without ``--box``: the targets are chosen on a page in the browser."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ssiam.addresses import display_name, is_address
from ssiam.cli.moments import PlannedTarget
from ssiam.cli.track_backward import run_backward
from ssiam.cli.track_corrections import run_corrected
from ssiam.cli.track_progress import RunProgress
from ssiam.cli.track_run import TrackJob, run_track
from ssiam.errors import ArgumentError, MissingExtraError, SourceError, SsiamError
from ssiam.exchange.blending import Keyframe
from ssiam.outputs import check_output
from ssiam.target_start import TargetStart
from ssiam.video import Frame
from ssiam.video.results import STDOUT
from ssiam.video.reversing import check_reversible
from ssiam.video.sources import STDIN, camera_index

if TYPE_CHECKING:
    from ssiam.web.picking.page import PickPage

_OTHER_WAYS = (
    "--pick proposes targets in the first frame, and --box x,y,width,height gives one, in pixels"
)
_PIPED = "--results - cannot be written again: to correct targets, start with --results FILE.csv"


def choose_and_track(
    job_for: Callable[[int], TrackJob], progress: RunProgress, *, backward: bool = False
) -> None:
    """Let a person choose the targets on a page, track them, and show there what was written.

    If a target has several keyframes, the targets are tracked between keyframes.

    Parameters
    ----------
    job_for : callable
        The job for a number of targets.
    progress : RunProgress
        Of the terminal.
    backward : bool
        Whether targets are tracked to the first frame.

    Raises
    ------
    SsiamError
        The page is not possible here, or was closed; else as the run.
    """
    job = job_for(1)
    source = job.source.spec
    _check_readable_twice(source)
    try:
        from ssiam.web.picking.page import PageClosedError, PickPage, open_in_browser
    except MissingExtraError as error:
        raise MissingExtraError(f"{error}; without it, {_OTHER_WAYS}") from error

    start, end = job.span.start, job.span.end

    def is_selectable(frame: Frame) -> bool:
        is_begun = start is None or start.is_reached(frame)
        return is_begun and (end is None or not end.is_passed(frame))

    is_piped = str(job.paths.results) == STDOUT
    if job.static_areas:
        with job.source.open() as frames:
            job.static_areas.check(frames.size_wh)
    tracker = job.tracker.load(job.config, job.static_areas.mask)
    with PickPage(
        job.source.open,
        tracker,
        name=job.tracker.tracker,
        is_selectable=is_selectable,
        no_keyframes=_no_keyframes(source, backward=backward),
        no_second_run=_PIPED if is_piped else None,
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
        made: TrackJob | None = None  # of the run before
        failure: SsiamError | None = None
        while True:
            try:
                keyframes = page.wait_for_targets()
            except PageClosedError:
                if made is None:
                    raise
                break  # a correction was begun and given up
            shown = _PageProgress(page)
            reports = [progress, shown]
            try:
                made = job_for(len(keyframes)) if made is None else _again(made, len(keyframes))
                doubts = _track(made, keyframes, page.first_index, reports, backward=backward)
            except SsiamError as error:
                failure = error
                page.finish(shown.written, [str(error)])
            else:
                failure = None
                page.finish(shown.written, [f"in {Path.cwd()}", *doubts])
            if not page.wait_until_done():
                break
        if failure is not None:
            raise failure


def _track(
    job: TrackJob,
    keyframes: Sequence[Sequence[Keyframe]],
    first_index: int,
    progress: Sequence[RunProgress],
    *,
    backward: bool,
) -> list[str]:
    """Track between keyframes, or from one box each; returns lines about doubtful frames."""
    if any(len(own) > 1 for own in keyframes):
        return run_corrected(job, [_begun(own, first_index) for own in keyframes], progress)
    run = run_backward if backward else run_track
    run(job, _planned(keyframes), progress)
    return []


def _again(job: TrackJob, targets: int) -> TrackJob:
    """The job of a further run, which replaces the outputs of the one before.

    Raises
    ------
    SinkError
        Another file, of a further target, exists and must not be replaced.
    """
    own = {path for _, path in job.paths.files()}
    paths = replace(job.paths, targets=targets, overwrite=True)
    for _, path in paths.files():
        if path not in own:
            check_output(path, overwrite=job.paths.overwrite)
    return replace(job, paths=paths)


def _planned(keyframes: Sequence[Sequence[Keyframe]]) -> list[PlannedTarget]:
    """The targets, each by its first box."""
    return [
        PlannedTarget.from_start(TargetStart(each.frame, each.xywh))
        for own in keyframes
        for each in own
        if each.xywh is not None
    ]


def _begun(keyframes: Sequence[Keyframe], first_index: int) -> list[Keyframe]:
    """The keyframes of a target that is absent before the first of them."""
    is_later = keyframes[0].frame > first_index
    return [*([Keyframe(first_index, None)] if is_later else []), *keyframes]


def _no_keyframes(source: str, *, backward: bool) -> str | None:
    """Why a target cannot have several keyframes; None if it can."""
    if backward:
        return "--backward tracks from one box: for further keyframes, start without --backward"
    try:
        check_reversible(source)
    except SourceError as error:
        return f"no further keyframe: {error}"
    return None


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
