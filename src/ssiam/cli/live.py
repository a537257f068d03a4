"""`ssiam live`: a browser page on which targets are drawn and tracked."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Final, Literal

from cyclopts import Group, Parameter

from ssiam.addresses import display_name
from ssiam.cli.boxes import box_files, parse_boxes
from ssiam.cli.live_headless import InitialTargets, open_when_there, run_headless
from ssiam.cli.moments import PlannedTarget
from ssiam.cli.options import (
    DEFAULT_STABILIZATION,
    DEFAULT_TRACKER_OPTIONS,
    RUNTIME_GROUP,
    TARGET_GROUP,
    StabilizationOptions,
    TrackerOptions,
    parse_levels,
    report_leftover_parts,
    report_uncalibrated,
)
from ssiam.cli.static_areas import StaticAreaOption, StaticAreas, static_area_files
from ssiam.errors import ArgumentError, IncompleteError
from ssiam.outputs import NamedPath, check_output, leftover_parts
from ssiam.video.results import STDOUT, result_paths
from ssiam.video.sinks import video_format
from ssiam.video.source_files import check_distinct_from_source
from ssiam.web import Health, Note, Session
from ssiam.web.feeds.opening import BROWSER
from ssiam.web.output_files import OutputFiles
from ssiam.web.recording_files import abandoned_recordings

if TYPE_CHECKING:
    from ssiam.web.server.serving import LiveServer

STUCK: Final = 3
"""Exit code if tracking does not stop."""

_OUTPUT_GROUP = Group("Output", sort_key=2)
_PAGE_GROUP = Group("Page", sort_key=2)
_INTERFACES_GROUP = Group("Interfaces", sort_key=3)


def live(
    source: Annotated[str, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    box: Annotated[
        list[str] | None,
        Parameter(group=TARGET_GROUP, negative=(), allow_leading_hyphen=True),
    ] = None,
    headless: Annotated[bool, Parameter(group=_OUTPUT_GROUP, negative=())] = False,
    out: Annotated[Path | None, Parameter(group=_OUTPUT_GROUP)] = None,
    results: Annotated[
        Path | None, Parameter(group=_OUTPUT_GROUP, allow_leading_hyphen=True)
    ] = None,
    overwrite: Annotated[bool, Parameter(group=_OUTPUT_GROUP, negative=())] = False,
    quiet: Annotated[
        bool, Parameter(name=("--quiet", "-q"), group=_OUTPUT_GROUP, negative=())
    ] = False,
    host: Annotated[str, Parameter(group=_PAGE_GROUP)] = "127.0.0.1",
    port: Annotated[int, Parameter(group=_PAGE_GROUP)] = 8765,
    token: Annotated[bool, Parameter(group=_PAGE_GROUP, negative="--no-token")] = True,
    pace: Annotated[Literal["clock", "fast"], Parameter(group=_PAGE_GROUP)] = "clock",
    recordings: Annotated[Path | None, Parameter(group=_PAGE_GROUP)] = None,
    stream: Annotated[int | None, Parameter(group=RUNTIME_GROUP)] = None,
    levels: Annotated[str | None, Parameter(group=RUNTIME_GROUP, allow_leading_hyphen=True)] = None,
    mavlink: Annotated[str | None, Parameter(group=_INTERFACES_GROUP)] = None,
    rerun: Annotated[Path | None, Parameter(group=_INTERFACES_GROUP)] = None,
    tracker_options: TrackerOptions = DEFAULT_TRACKER_OPTIONS,
    static_area: StaticAreaOption = None,
    config: StabilizationOptions = DEFAULT_STABILIZATION,
) -> None:
    """Show a source in the browser; draw targets with the mouse to track them.

    A file waits on its first frame for a visitor of the page, unless there is other work: --box,
    --out, --results, --mavlink or --rerun.

    Only this machine can open the page, unless --host is given. The printed address contains a
    token, without which nobody sees the session, not even another user of this machine.

    Parameters
    ----------
    source
        Camera index, rtsp:// or http:// address, video file, folder of images, - for standard
        input, or browser: the camera of the browser that opens the page.
    box
        Target in the first frame, x,y,width,height in pixels, as in ssiam track; it is tracked from
        there, as if it were drawn on the page. Repeat for further targets.
    headless
        Open no page: track the targets of --box until the source ends, or until SIGTERM or Ctrl-C,
        which finish the outputs. A source that is not there yet is waited for.
    out
        Annotated video to write from the first frame on: .mp4, .mkv, .mov or .avi.
    results
        Results to write from the first frame on: .csv or .jsonl; - writes JSON lines to standard
        output.
    overwrite
        Replace existing files; without this option ssiam does not start.
    quiet
        Print errors only.
    host
        Address to listen on; 0.0.0.0 for all addresses of this machine.
    port
        Port to listen on; 0 selects a free one.
    token
        Require the token of the printed address; --no-token lets in whoever reaches the port, on
        this machine all its users.
    pace
        Pace of a file: clock plays it by its frame times, fast as fast as the tracker runs.
    recordings
        Folder in which recordings are kept; without this option they are deleted at the end.
    stream
        Index of the video stream, from 0; by default the one with the most pixels.
    levels
        LOW,HIGH: the values shown as black and as white, for sources with more than 8 bits per
        value, such as thermal cameras: 7000,8500. By default estimated from the first frames.
    mavlink
        MAVLink connection to a ground station, for which ssiam is then a tracking camera:
        udpout:127.0.0.1:14550, for example.
    rerun
        File for the Rerun viewer, .rrd, to which frames, boxes and camera motion are logged.
    static_area
        What moves with the camera, such as your vehicle, a display or a logo, and is left out of
        the camera motion: x,y,width,height in pixels, or @FILE with an image of the frames' size
        that is not black there. Repeat for further areas.
    """
    outputs = _Outputs(recordings, out, results, rerun, overwrite)
    targets = parse_boxes(box or [])
    if headless:
        _check_headless(source, targets, outputs, mavlink)
    areas = StaticAreas.parse(static_area)
    files = [*box_files(box or []), *static_area_files(static_area)]
    outputs.check(source, [*tracker_options.weight_files(), *files], quiet=quiet)
    tracker = tracker_options.load(config, areas.mask)
    if not (quiet or tracker.score_is_calibrated):
        report_uncalibrated(tracker_options.tracker)

    def show(news: Note | Health) -> None:
        if news.message and not (quiet and isinstance(news, Note) and news.level == "info"):
            print(f"ssiam: {news.message}", file=sys.stderr, flush=True)

    def open_session() -> Session:
        return Session.open(
            source,
            tracker,
            name=tracker_options.tracker,
            pace=pace,
            recordings=recordings,
            stream=stream,
            levels=parse_levels(levels),
            # A file would be over before somebody has opened the page, unless there is other work.
            paused=not (headless or targets or out or results or mavlink or rerun),
        )

    with ExitStack() as stack:
        session = (
            open_when_there(open_session, source, lambda text: show(Note("info", text)))
            if headless
            else open_session()
        )
        stack.push(partial(_exit_if_stuck, session))
        _check_areas(session, areas)
        written = _opened(stack, session, out, results, overwrite=overwrite)
        stack.callback(session.close)
        session.listen_notes(show)
        session.listen_health(show)
        initial = InitialTargets(session, targets, notify=not headless)
        for folder in abandoned_recordings():
            text = f"{folder} has recordings of a session that was killed: --recordings {folder}"
            show(Note("info", f"{text} lists them"))
        server = None if headless else _server(session, host, port, needs_token=token)
        if server is not None and server.is_open_to_machines:
            text = "any machine that reaches it can watch, record and steer: omit --no-token"
            show(Note("warning", f"{server.url} needs no token: {text}"))
        session.start()
        if mavlink is not None:
            from ssiam.web.mavlink.camera import MavlinkCamera

            stack.enter_context(MavlinkCamera(session, mavlink))
        if rerun is not None:
            from ssiam.web.rerun import RerunRecorder

            stack.enter_context(RerunRecorder(session, rerun, overwrite=overwrite))
        if server is None:
            run_headless(session, initial, written)
        else:
            to = sys.stderr if str(results) == STDOUT else sys.stdout
            print(f"{session.info.source}: {server.address} (Ctrl-C ends)", file=to, flush=True)
            server.run()
    if written is not None and written.error is not None:
        raise written.error
    if session.health.state == "failed":
        raise IncompleteError(session.health.message)


def _check_areas(session: Session, areas: StaticAreas) -> None:
    """Raise `ArgumentError` for areas that do not fit the frames, if their size is known yet."""
    size_wh = session.info.size_wh
    if size_wh is None:
        return
    try:
        areas.check(size_wh)
    except ArgumentError:
        session.close()
        raise


def _server(session: Session, host: str, port: int, *, needs_token: bool) -> LiveServer:
    # Without the page, the packages of its server are not needed.
    from ssiam.web.server.serving import LiveServer

    return LiveServer(session, host, port, needs_token=needs_token)


def _opened(
    stack: ExitStack, session: Session, out: Path | None, results: Path | None, *, overwrite: bool
) -> OutputFiles | None:
    """The files of --out and --results, closed by `stack`; None if there are none."""
    if out is None and results is None:
        return None
    return stack.enter_context(OutputFiles(session, out, results, overwrite=overwrite))


@dataclass(frozen=True)
class _Outputs:
    """The outputs that the options name."""

    recordings: Path | None
    out: Path | None
    results: Path | None
    rerun: Path | None
    overwrite: bool

    def check(self, source: str, inputs: list[NamedPath], *, quiet: bool) -> None:
        """Refuse outputs that are inputs, and existing files without --overwrite."""
        results = () if self.results is None else result_paths(self.results)
        files = [("--results", path) for path in results]
        if self.results is not None and self.results.suffix.lower() == ".txt":
            raise ArgumentError(
                f"--results {self.results}: targets come and go in a live source: give a .csv or "
                ".jsonl file, or -"
            )
        options = (("--out", self.out), ("--rerun", self.rerun))
        files += [(option, path) for option, path in options if path is not None]
        folders = [] if self.recordings is None else [("--recordings", self.recordings)]
        check_distinct_from_source([*folders, *files], source, inputs)
        for _, path in files:
            check_output(path, overwrite=self.overwrite)
            if not quiet:
                report_leftover_parts(leftover_parts(path))
        if self.out is not None:
            video_format(self.out)


def _check_headless(
    source: str, targets: Sequence[PlannedTarget], outputs: _Outputs, mavlink: str | None
) -> None:
    """Raise `ArgumentError` for options that make no sense without the page."""
    if source == BROWSER:
        raise ArgumentError("the source browser needs the page: omit --headless")
    if not targets:
        name = display_name(source)
        raise ArgumentError(
            f"{name}: --headless needs a target: give --box x,y,width,height, which ssiam track "
            f"{name} --pick proposes, or omit --headless to draw it on the page"
        )
    if outputs.recordings is not None:
        raise ArgumentError("--recordings is for recording from the page: give --out and --results")
    if (outputs.out, outputs.results, outputs.rerun, mavlink) == (None,) * 4:
        raise ArgumentError(
            "--headless writes nothing: give --out, --results, --rerun or --mavlink"
        )


def _exit_if_stuck(
    session: Session,
    kind: type[BaseException] | None,
    error: BaseException | None,
    trace: TracebackType | None,
) -> None:
    """Exit the process at once if the thread of a closed session is stuck, which would block it."""
    if not session.stuck:
        return
    print(f"ssiam: {session.health.message or 'tracking did not stop'}", file=sys.stderr)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    code = error.code if isinstance(error, SystemExit) else None
    os._exit(code if isinstance(code, int) else STUCK)
