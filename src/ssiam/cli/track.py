"""`ssiam track`: follow one or several targets through a video."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from ssiam.cli.arguments import levels as parsed_levels
from ssiam.cli.arguments import report_left_parts
from ssiam.cli.choice import RUNNING, STEADYING, TARGET, TrackerChoice
from ssiam.cli.outputs import Destinations, Outputs
from ssiam.cli.report import Progress, Report
from ssiam.errors import ArgumentError, StreamError
from ssiam.geometry import XYWH
from ssiam.stabilize import StabilizerConfig
from ssiam.track import Track
from ssiam.trackers import TrackerGroup
from ssiam.video import Frame, RawFormat, Source, open_source, with_following

_CHOICE = TrackerChoice()
_STEADY = StabilizerConfig()

_OUTPUT = Group("Output", sort_key=2)


def track(
    source: Annotated[str, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    box: Annotated[
        list[str],
        Parameter(group=TARGET, negative=(), allow_leading_hyphen=True),
    ],
    out: Annotated[Path | None, Parameter(group=_OUTPUT)] = None,
    results: Annotated[Path | None, Parameter(group=_OUTPUT)] = None,
    layout: Annotated[str | None, Parameter(group=_OUTPUT)] = None,
    plot: Annotated[Path | None, Parameter(group=_OUTPUT)] = None,
    side_by_side: Annotated[bool, Parameter(group=_OUTPUT, negative=())] = False,
    overwrite: Annotated[bool, Parameter(group=_OUTPUT, negative=())] = False,
    raw: Annotated[str | None, Parameter(group=RUNNING)] = None,
    stream: Annotated[int | None, Parameter(group=RUNNING)] = None,
    levels: Annotated[str | None, Parameter(group=RUNNING, allow_leading_hyphen=True)] = None,
    choice: TrackerChoice = _CHOICE,
    config: Annotated[StabilizerConfig, Parameter(name="*", group=STEADYING)] = _STEADY,
) -> None:
    """Follow targets through a video from a moving camera.

    Without --out, --results and --plot, the tracked video and a CSV file are written to the
    current folder, named after the source and counted up: clip-tracked.mp4, clip-tracked-2.mp4.

    Each output grows as NAME.part.EXT and gets its name at the end, also after Ctrl-C. What a run
    that was killed leaves in its part plays, or has whole lines. An output may not be an input.

    Parameters
    ----------
    source
        Video file, folder of images, camera number, rtsp:// or http:// address, or - for
        standard input.
    box
        Target in the first frame: x,y,width,height in pixels, x and y its top left corner.
        Give it again for each further target.
    out
        Video to write: .mp4 (H.264), .mkv or .avi. The source's sound is copied into it.
    results
        File of results to write: .csv, .jsonl or .txt.
    layout
        Layout of a .txt file: otb (x,y,w,h from 1), mot, or vot.
    plot
        Picture of the camera's path and its steadying: .png, .svg or .pdf.
    side_by_side
        Show the steadied view beside the raw frame in the video.
    overwrite
        Replace files that exist; without it they are refused.
    raw
        Size, layout and rate of headerless frames: 640x360,bgr24,30.
    stream
        Which video stream of a source with several, from 0; unless given, the one with the most
        pixels.
    levels
        Values to be shown as black and white, of sources with more than 8 bits a value, such as
        thermal cameras: 7000,8500. Unless given, the first frames tell.
    """
    boxes = [_box(text) for text in box]
    if out is None and results is None and plot is None:
        destinations = Destinations.by_default(_stem(source), len(boxes), overwrite)
    else:
        destinations = Destinations.given(out, results, plot, layout, len(boxes), overwrite)
    destinations.check(source, choice.weight_files())
    report_left_parts(destinations.left)
    with ExitStack() as stack:
        frames = stack.enter_context(
            open_source(
                source,
                raw=_raw_format(raw),
                stream=stream,
                levels=parsed_levels(levels),
                sound=destinations.video is not None,
            )
        )
        first = next(frames)
        group = TrackerGroup(choice.load(config), keep_going=True)
        group.init(first.image, boxes)
        outputs = Outputs(frames, destinations, side_by_side=side_by_side, config=config)
        report = Report(frames.name, choice.tracker, config.stabilize, len(boxes))
        stack.callback(lambda: report.show(outputs.locations(), _remarks(frames, outputs)))
        stack.enter_context(outputs)
        _follow(group, first, frames, boxes, outputs, report, choice.threads)
    report.check_whole()
    if frames.info.undecoded:
        raise StreamError(
            f"{frames.name}: {_undecoded(frames)}; what came before and after them was tracked"
        )


def _remarks(frames: Source, outputs: Outputs) -> list[str]:
    """What the user should know of the source and the outputs, a line each."""
    lost = [_undecoded(frames)] if frames.info.undecoded else []
    return [*(f"source: {line}" for line in (*frames.info.remarks, *lost)), *outputs.remarks]


def _undecoded(frames: Source) -> str:
    count = frames.info.undecoded
    return f"{count} frame{'s' * (count > 1)} of it could not be decoded and are left out"


def _follow(
    group: TrackerGroup,
    first: Frame,
    frames: Source,
    boxes: Sequence[XYWH],
    outputs: Outputs,
    report: Report,
    threads: int,
) -> None:
    """Track to the end of the frames."""
    outputs.write(first, [Track(box) for box in boxes])
    with Progress(frames.length) as progress:
        for frame, following in _paired(frames, threads):
            with report.clock:
                tracks = group.update(frame.image, None if following is None else following.image)
            report.add(tracks)
            report.fail(frame.index, group)
            outputs.write(frame, tracks, report.clock.fps)
            progress.step(report.clock.fps)


def _paired(frames: Source, threads: int) -> Iterator[tuple[Frame, Frame | None]]:
    """Each frame with the next one, where that is at hand and another core may work on it."""
    if frames.length is not None and threads > 1:
        return with_following(frames)
    return ((frame, None) for frame in frames)


def _box(text: str) -> XYWH:
    try:
        x, y, w, h = (float(number) for number in text.split(","))
    except ValueError:
        raise ArgumentError(
            f"--box {text!r} is not a box: give x,y,width,height in pixels, such as 120,80,40,60"
        ) from None
    return x, y, w, h


def _raw_format(text: str | None) -> RawFormat | None:
    if text is None:
        return None
    try:
        size, pixel_format, fps = text.split(",")
        width, height = (int(number) for number in size.split("x"))
        return RawFormat((width, height), pixel_format, Fraction(fps))
    except (ValueError, ZeroDivisionError):
        raise ArgumentError(
            f"--raw {text!r} is not a raw format: give size, layout and rate, "
            "such as 640x360,bgr24,30"
        ) from None


def _stem(source: str) -> str:
    """Name for outputs: the file's or folder's, a camera's number, or `stream`."""
    stem = Path(source.split("?")[0]).stem if "://" not in source else ""
    return stem if stem not in ("", "-") else "stream"
