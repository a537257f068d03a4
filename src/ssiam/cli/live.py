"""`ssiam live`: a page in the browser on which targets are drawn and followed."""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Annotated, Final, Literal

from cyclopts import Group, Parameter

from ssiam.cli.arguments import levels as parsed_levels
from ssiam.cli.arguments import report_left_parts
from ssiam.cli.choice import RUNNING, STEADYING, TrackerChoice
from ssiam.errors import IncompleteError
from ssiam.outputs import NamedPath, check_output, leftover_parts
from ssiam.stabilize import StabilizerConfig
from ssiam.video.source_files import check_apart_from_source
from ssiam.web import Health, Note, Session
from ssiam.web.recording import left_behind

_CHOICE = TrackerChoice()
_STEADY = StabilizerConfig()

STUCK: Final = 3
"""Exit code where tracking did not come to an end."""

_PAGE = Group("Page", sort_key=2)
_MACHINES = Group("Other programs", sort_key=3)


def live(
    source: Annotated[str, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    host: Annotated[str, Parameter(group=_PAGE)] = "127.0.0.1",
    port: Annotated[int, Parameter(group=_PAGE)] = 8765,
    token: Annotated[bool, Parameter(group=_PAGE, negative=())] = False,
    pace: Annotated[Literal["clock", "fast"], Parameter(group=_PAGE)] = "clock",
    recordings: Annotated[Path | None, Parameter(group=_PAGE)] = None,
    stream: Annotated[int | None, Parameter(group=RUNNING)] = None,
    levels: Annotated[str | None, Parameter(group=RUNNING, allow_leading_hyphen=True)] = None,
    mavlink: Annotated[str | None, Parameter(group=_MACHINES)] = None,
    rerun: Annotated[Path | None, Parameter(group=_MACHINES)] = None,
    overwrite: Annotated[bool, Parameter(group=_MACHINES, negative=())] = False,
    choice: TrackerChoice = _CHOICE,
    config: Annotated[StabilizerConfig, Parameter(name="*", group=STEADYING)] = _STEADY,
) -> None:
    """Show a source in the browser; targets are drawn with the mouse and followed.

    Only this machine can open the page, unless --host says otherwise; then the address that is
    printed holds a token, without which nothing is shown.

    Parameters
    ----------
    source
        Camera number, rtsp:// or http:// address, video file, folder of images, - for standard
        input, or browser: the camera of whoever opens the page.
    host
        Address to listen on; 0.0.0.0 is all of this machine's.
    port
        To listen on; 0 takes a free one.
    token
        Ask for a token on this machine too.
    pace
        Of a file: by its clock, or as fast as it can be tracked.
    recordings
        Folder that keeps what is recorded; without it recordings are gone at the end.
    stream
        Which video stream of a source with several, from 0; unless given, the one with the most
        pixels.
    levels
        Values to be shown as black and white, of sources with more than 8 bits a value, such as
        thermal cameras: 7000,8500. Unless given, the first frame tells.
    mavlink
        Be a camera that tracks for a ground station: udpout:127.0.0.1:14550, or what else MAVLink
        can connect to.
    rerun
        File to log everything to for the Rerun viewer: .rrd.
    overwrite
        Replace the file of --rerun if it exists; without it one is refused.
    """
    from ssiam.web.server.serving import LiveServer

    _check_outputs(source, choice.weight_files(), recordings, rerun, overwrite=overwrite)
    tracker = choice.load(config)
    with ExitStack() as stack:
        session = Session.open(
            source,
            tracker,
            name=choice.tracker,
            pace=pace,
            recordings=recordings,
            stream=stream,
            levels=parsed_levels(levels),
        )
        stack.push(partial(_leave, session))
        stack.callback(session.close)
        session.notes(_show)
        session.healths(_show)
        for folder in left_behind():
            text = f"{folder} has recordings of a session that was killed: --recordings {folder}"
            _show(Note("info", f"{text} lists them"))
        server = LiveServer(session, host, port, needs_token=token)
        session.start()
        if mavlink is not None:
            from ssiam.web.mavlink.camera import MavlinkCamera

            stack.enter_context(MavlinkCamera(session, mavlink))
        if rerun is not None:
            from ssiam.web.rerun_tap import RerunTap

            stack.enter_context(RerunTap(session, rerun, overwrite=overwrite))
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
    """Refuse outputs that are inputs, and a file of --rerun that is not to be replaced."""
    options = (("--recordings", recordings), ("--rerun", rerun))
    outputs = [(option, path) for option, path in options if path is not None]
    check_apart_from_source(outputs, source, weights)
    if rerun is not None:
        check_output(rerun, overwrite=overwrite)
        report_left_parts(leftover_parts(rerun))


def _leave(
    session: Session,
    kind: type[BaseException] | None,
    error: BaseException | None,
    trace: TracebackType | None,
) -> None:
    """End the process at once if a closed session's thread is stuck: nothing else would end it."""
    if not session.stuck:
        return
    print(f"ssiam: {session.health.message or 'tracking did not end'}", file=sys.stderr)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    code = error.code if isinstance(error, SystemExit) else None
    os._exit(code if isinstance(code, int) else STUCK)


def _show(news: Note | Health) -> None:
    if news.message:
        print(f"ssiam: {news.message}", file=sys.stderr, flush=True)
