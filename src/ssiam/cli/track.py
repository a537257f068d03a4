"""`ssiam track`: track one or several targets through a video."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ssiam.addresses import display_name
from ssiam.cli.boxes import box_files, parse_boxes
from ssiam.cli.moments import Span, moment_option
from ssiam.cli.options import (
    DEFAULT_STABILIZATION,
    DEFAULT_TRACKER_OPTIONS,
    RUNTIME_GROUP,
    TARGET_GROUP,
    StabilizationOptions,
    TrackerOptions,
    parse_levels,
    report_leftover_parts,
)
from ssiam.cli.pick import pick_boxes
from ssiam.cli.static_areas import StaticAreaOption, StaticAreas, static_area_files
from ssiam.cli.track_backward import run_backward
from ssiam.cli.track_corrections import run_corrected
from ssiam.cli.track_outputs import OutputPaths
from ssiam.cli.track_page import choose_and_track
from ssiam.cli.track_progress import TerminalProgress
from ssiam.cli.track_run import DEFAULT_VIDEO, SourceOptions, TrackJob, run_track
from ssiam.cli.track_views import OUTPUT_GROUP, VideoOptions
from ssiam.errors import ArgumentError
from ssiam.exchange import Keyframe, read_annotations, read_corrections
from ssiam.parsing import parse_rate
from ssiam.video import RawFormat
from ssiam.video.reversing import check_reversible


def track(
    source: Annotated[str, Parameter(allow_leading_hyphen=True)],
    /,
    *,
    box: Annotated[
        list[str] | None,
        Parameter(group=TARGET_GROUP, negative=(), allow_leading_hyphen=True),
    ] = None,
    pick: Annotated[bool, Parameter(group=TARGET_GROUP, negative=())] = False,
    start: Annotated[str | None, Parameter(group=TARGET_GROUP, allow_leading_hyphen=True)] = None,
    end: Annotated[str | None, Parameter(group=TARGET_GROUP, allow_leading_hyphen=True)] = None,
    backward: Annotated[bool, Parameter(group=TARGET_GROUP, negative=())] = False,
    corrections: Annotated[Path | None, Parameter(group=TARGET_GROUP)] = None,
    previous: Annotated[Path | None, Parameter(group=TARGET_GROUP)] = None,
    out: Annotated[Path | None, Parameter(group=OUTPUT_GROUP, allow_leading_hyphen=True)] = None,
    results: Annotated[
        Path | None, Parameter(group=OUTPUT_GROUP, allow_leading_hyphen=True)
    ] = None,
    layout: Annotated[str | None, Parameter(group=OUTPUT_GROUP)] = None,
    masks: Annotated[bool, Parameter(group=OUTPUT_GROUP, negative=())] = False,
    plot: Annotated[Path | None, Parameter(group=OUTPUT_GROUP)] = None,
    video: VideoOptions = DEFAULT_VIDEO,
    overwrite: Annotated[bool, Parameter(group=OUTPUT_GROUP, negative=())] = False,
    quiet: Annotated[
        bool, Parameter(name=("--quiet", "-q"), group=OUTPUT_GROUP, negative=())
    ] = False,
    raw: Annotated[str | None, Parameter(group=RUNTIME_GROUP)] = None,
    stream: Annotated[int | None, Parameter(group=RUNTIME_GROUP)] = None,
    levels: Annotated[str | None, Parameter(group=RUNTIME_GROUP, allow_leading_hyphen=True)] = None,
    tracker_options: TrackerOptions = DEFAULT_TRACKER_OPTIONS,
    static_area: StaticAreaOption = None,
    config: StabilizationOptions = DEFAULT_STABILIZATION,
) -> None:
    """Track targets through a video from a moving camera.

    Without --box, a page opens in the browser, on which the targets are clicked, and corrected in
    further frames.

    Without --out, --results and --plot, the annotated video and a CSV file are written to the
    current folder. They are named after the source, and numbered if such files exist:
    clip-tracked.mp4, clip-tracked-2.mp4.

    Each output is written to NAME.part.EXT, which is renamed at the end, also after Ctrl-C. If a
    run is killed, its partial video can be played and its partial results consist of complete
    lines. An output must not be an input.

    Parameters
    ----------
    source
        Video file, folder of images, camera index, rtsp:// or http:// address, or - for standard
        input.
    box
        Target in the first frame: x,y,width,height in pixels, with x and y of its top left corner,
        also as four words. MOMENT:x,y,width,height is a target that begins later: 300: at a
        frame, 12s: or 0:12: at a time. @FILE.csv has a target in each line: columns x,y,w,h and,
        if it begins later, frame or time. Repeat for further targets. Without this option, targets
        are clicked on a page in the browser.
    pick
        Track nothing: write the first frame, or that of --start, with numbered proposals to
        NAME-pick.png, and print the command that tracks each of them.
    start
        First frame that is tracked and written: a frame number, from 0 (300), or a time by the
        frames' timestamps (12s, 0:12, 1:02:03.5), which means the first frame at or after it.
    end
        Last frame that is tracked and written, as for --start; a time means the last frame at or
        before it.
    backward
        Track from a later frame to the first one, or to --start. A --box without a time is then in
        the last frame, or in that of --end. Results and video are in the order of the frames. The
        source must be a file or a folder, which is read three times.
    corrections
        Keyframes that were corrected in an annotation tool, instead of --box: .xml of CVAT, .json
        of Label Studio, or .csv or .jsonl of this program. The targets are tracked between them,
        forward and backward, and the frames to look at next are printed. The source must be a file
        or a folder, which is read three times.
    previous
        Results that were exported for the tool, .csv or .jsonl: only boxes that differ from them
        are taken from --corrections, and their own keyframes are kept.
    out
        Annotated video to write, in H.264: .mp4, .mkv, .mov or .avi. The sound of the source is
        copied.
    results
        Results to write: .csv, .jsonl or .txt; - writes JSON lines to standard output, and the
        summary to standard error.
    layout
        Layout of a .txt file: otb (x,y,w,h, 1-based; the default), mot (MOTChallenge, 1-based) or
        vot (0-based).
    masks
        Write each target's mask to the results too, .csv or .jsonl: COCO's compressed run lengths.
        For trackers that have masks, such as the default one.
    plot
        Plot of the camera path and its stabilization: .png, .svg or .pdf.
    overwrite
        Replace existing files; without this option ssiam does not start.
    quiet
        Print errors only: no progress bar and no summary.
    raw
        SIZE,PIXEL_FORMAT,FPS of raw frames without a header, in a file or from standard input:
        640x360,bgr24,30.
    stream
        Index of the video stream, from 0; by default the one with the most pixels.
    levels
        LOW,HIGH: the values shown as black and as white, for sources with more than 8 bits per
        value, such as thermal cameras: 7000,8500. By default estimated from the first frames.
    static_area
        What moves with the camera, such as your vehicle, a display or a logo, and is left out of
        the camera motion: x,y,width,height in pixels, or @FILE with an image of the frames' size
        that is not black there. Repeat for further areas.
    """
    span = Span(moment_option("--start", start), moment_option("--end", end))
    video.check()
    areas = StaticAreas.parse(static_area)
    options = SourceOptions(source, _raw_format(raw), stream, parse_levels(levels))

    def job_for(targets: int) -> TrackJob:
        """The job of so many targets; raises if an output is an input or cannot be written."""
        if out is None and results is None and plot is None:
            paths = OutputPaths.default(_stem(source), targets, overwrite)
        else:
            paths = OutputPaths.explicit(out, results, plot, layout, targets, overwrite)
        paths = replace(paths, masks=masks)
        given = (("--corrections", corrections), ("--previous", previous))
        files = [(name, path) for name, path in given if path is not None]
        files += [*box_files(box or []), *static_area_files(static_area)]
        paths.check(source, [*tracker_options.weight_files(), *files])
        return TrackJob(options, paths, tracker_options, config, span, video, quiet, areas)

    if backward and layout == "vot":
        raise ArgumentError("--layout vot has a target's first line first: omit --backward")
    if pick:
        if corrections is not None:
            raise ArgumentError(f"--pick tracks nothing: omit --corrections {corrections}")
        _check_pick(box, backward=backward)
        span.check([])
        given = (("--raw", raw), ("--stream", stream), ("--levels", levels))
        moments = (("--start", start), ("--end", end))
        static = (("--static-area", text) for text in static_area or ())
        words = [
            f"{value}"
            for name, text in (*given, *moments, *static)
            if text is not None
            for value in (name, text)
        ]
        command = ["ssiam", "track", display_name(source), *words]
        pick_boxes(options, span, areas, _stem(source), command)
        return
    if previous is not None and corrections is None:
        raise ArgumentError(f"--previous {previous} is compared with --corrections: give both")
    if corrections is not None:
        _check_corrections(box, backward=backward)
        span.check([])
        keyframes = _keyframes(options, corrections, previous)
        job = job_for(len(keyframes))
        if not quiet:
            report_leftover_parts(job.paths.leftover_parts)
        run_corrected(job, keyframes, [TerminalProgress(quiet=quiet)])
        return
    targets = parse_boxes(box or [])
    span.check(targets)
    job = job_for(len(targets) or 1)
    if not quiet:
        report_leftover_parts(job.paths.leftover_parts)
    progress = TerminalProgress(quiet=quiet)
    if not box:
        choose_and_track(job_for, progress, backward=backward)
    elif backward:
        run_backward(job, targets, [progress])
    else:
        run_track(job, targets, [progress])


def _check_corrections(box: list[str] | None, *, backward: bool) -> None:
    """Raise `ArgumentError` for options that contradict ``--corrections``."""
    if box:
        raise ArgumentError(f"--corrections gives all boxes, and --box {box[0]} gives one: omit it")
    if backward:
        raise ArgumentError("--corrections tracks forward and backward: omit --backward")


def _keyframes(
    source: SourceOptions, corrections: Path, previous: Path | None
) -> list[list[Keyframe]]:
    """The keyframes of each target; raises as `check_reversible` and `read_corrections`."""
    check_reversible(source.spec)
    with source.open() as frames:
        size_wh, fps = frames.size_wh, frames.fps
    earlier = None if previous is None else read_annotations(previous, size_wh, fps)
    return read_corrections(corrections, size_wh, fps, earlier)


def _check_pick(box: list[str] | None, *, backward: bool) -> None:
    """Raise `ArgumentError` for options that contradict ``--pick``."""
    if box:
        raise ArgumentError(f"--pick proposes boxes, and --box {box[0]} gives one: omit one")
    if backward:
        raise ArgumentError(
            "--pick shows the first frame, and --backward starts at a later one: give --pick "
            "--start FRAME, then --backward --box FRAME:x,y,width,height"
        )


def _raw_format(text: str | None) -> RawFormat | None:
    if text is None:
        return None
    try:
        size, pixel_format, fps = text.split(",")
        width, height = (int(number) for number in size.split("x"))
        return RawFormat((width, height), pixel_format, parse_rate(fps))
    except ValueError:
        raise ArgumentError(
            f"--raw {text[:80]!r} is not a raw format: give size, pixel format and rate, "
            "such as 640x360,bgr24,30"
        ) from None


def _stem(source: str) -> str:
    """Base name of outputs: name of the file or folder, index of the camera, or "stream"."""
    stem = Path(source.split("?")[0]).stem if display_name(source) == source else ""
    return stem if stem not in ("", "-") else "stream"
