"""`ssiam live`: a browser page on which targets are drawn and tracked."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Annotated, Final, Literal

from cyclopts import Group, Parameter

from ssiam.cli.options import (
    DEFAULT_STABILIZATION,
    DEFAULT_TRACKER_OPTIONS,
    RUNTIME_GROUP,
    StabilizationOptions,
    TrackerOptions,
    parse_levels,
    report_leftover_parts,
)
from ssiam.errors import IncompleteError
from ssiam.outputs import NamedPath, check_output, leftover_parts
from ssiam.video.source_files import check_distinct_from_source
from ssiam.web import Health, Note, Session
from ssiam.web.recording_files import abandoned_recordings

STUCK: Final = 3
"""Exit code if tracking does not stop."""

_PAGE_GROUP = Group("Page", sort_key=2)
_INTERFACES_GROUP = Group("Interfaces", sort_key=3)


def live(
    source: Annotated[str, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    host: Annotated[str, Parameter(group=_PAGE_GROUP)] = "127.0.0.1",
    port: Annotated[int, Parameter(group=_PAGE_GROUP)] = 8765,
    token: Annotated[bool, Parameter(group=_PAGE_GROUP, negative=())] = False,
    pace: Annotated[Literal["clock", "fast"], Parameter(group=_PAGE_GROUP)] = "clock",
    recordings: Annotated[Path | None, Parameter(group=_PAGE_GROUP)] = None,
    stream: Annotated[int | None, Parameter(group=RUNTIME_GROUP)] = None,
    levels: Annotated[str | None, Parameter(group=RUNTIME_GROUP, allow_leading_hyphen=True)] = None,
    mavlink: Annotated[str | None, Parameter(group=_INTERFACES_GROUP)] = None,
    rerun: Annotated[Path | None, Parameter(group=_INTERFACES_GROUP)] = None,
    overwrite: Annotated[bool, Parameter(group=_INTERFACES_GROUP, negative=())] = False,
    tracker_options: TrackerOptions = DEFAULT_TRACKER_OPTIONS,
    config: StabilizationOptions = DEFAULT_STABILIZATION,
) -> None:
    """Show a source in the browser; draw targets with the mouse to track them.

    A file waits on its first frame for a visitor of the page, unless --mavlink or --rerun is given.

    Only this machine can open the page, unless --host is given; then the printed address contains
    a token that is required to open the page.

    Parameters
    ----------
    source
        Camera index, rtsp:// or http:// address, video file, folder of images, - for standard
        input, or browser: the camera of the browser that opens the page.
    host
        Address to listen on; 0.0.0.0 for all addresses of this machine.
    port
        Port to listen on; 0 selects a free one.
    token
        Require a token on this machine too.
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
    overwrite
        Let --rerun replace an existing file; without this option ssiam does not start.
    """
    from ssiam.web.server.serving import LiveServer

    _check_outputs(source, tracker_options.weight_files(), recordings, rerun, overwrite=overwrite)
    tracker = tracker_options.load(config)
    with ExitStack() as stack:
        session = Session.open(
            source,
            tracker,
            name=tracker_options.tracker,
            pace=pace,
            recordings=recordings,
            stream=stream,
            levels=parse_levels(levels),
            # Otherwise a file would be over before somebody has opened the page.
            paused=mavlink is None and rerun is None,
        )
        stack.push(partial(_exit_if_stuck, session))
        stack.callback(session.close)
        session.listen_notes(_show)
        session.listen_health(_show)
        for folder in abandoned_recordings():
            text = f"{folder} has recordings of a session that was killed: --recordings {folder}"
            _show(Note("info", f"{text} lists them"))
        server = LiveServer(session, host, port, needs_token=token)
        session.start()
        if mavlink is not None:
            from ssiam.web.mavlink.camera import MavlinkCamera

            stack.enter_context(MavlinkCamera(session, mavlink))
        if rerun is not None:
            from ssiam.web.rerun import RerunRecorder

            stack.enter_context(RerunRecorder(session, rerun, overwrite=overwrite))
        print(f"{session.info.source}: {server.address} (Ctrl-C ends)", flush=True)
        server.run()
    if session.health.state == "failed":
        raise IncompleteError(session.health.message)


def _check_outputs(
    source: str,
    weights: list[NamedPath],
    recordings: Path | None,
    rerun: Path | None,
    *,
    overwrite: bool,
) -> None:
    """Refuse outputs that are inputs, and an existing file of --rerun without --overwrite."""
    options = (("--recordings", recordings), ("--rerun", rerun))
    outputs = [(option, path) for option, path in options if path is not None]
    check_distinct_from_source(outputs, source, weights)
    if rerun is not None:
        check_output(rerun, overwrite=overwrite)
        report_leftover_parts(leftover_parts(rerun))


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


def _show(news: Note | Health) -> None:
    if news.message:
        print(f"ssiam: {news.message}", file=sys.stderr, flush=True)
