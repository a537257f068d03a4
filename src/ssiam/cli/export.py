"""`ssiam export`: results in the formats of annotation tools."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ssiam.cli.arguments import report_left_parts, words
from ssiam.errors import ArgumentError
from ssiam.exchange import ExportKind, read_annotations, timeline, write_exports
from ssiam.outputs import check_distinct, check_output, is_stream, leftover_parts
from ssiam.video import open_source
from ssiam.video.source_files import check_apart_from_source


def export(
    results: Path,
    /,
    *,
    to: ExportKind,
    out: Path,
    video: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    size: str | None = None,
    fps: str | None = None,
    names: str | None = None,
    overwrite: Annotated[bool, Parameter(negative=())] = False,
    stream: int | None = None,
) -> None:
    """Write the results of ssiam track for an annotation tool.

    Formats need the size and the rate of the video's frames: give the video, or both of them.

    Parameters
    ----------
    results
        File that ssiam track --results wrote: .csv or .jsonl.
    to
        cvat: XML, "CVAT for video 1.1". coco: JSON. labelstudio: JSON of a task. got10k: zip with
        a folder a target.
    out
        File to write.
    video
        The video that was tracked, to take size and rate from.
    size
        Width and height of its frames in pixels: 1280x720.
    fps
        Frames a second: 25, 29.97 or 30000/1001.
    names
        The targets' names between commas, in their order; by default target 1, target 2, ...
    stream
        Which video stream of --video was tracked, from 0; unless given, the one with the most
        pixels.
    overwrite
        Replace a file that exists, when the new one is whole; without it one is refused.
    """
    inputs = [("results", results)]
    if video is None:
        check_distinct([("--out", out)], inputs)
    else:
        check_apart_from_source([("--out", out)], video, inputs)
    check_output(out, overwrite=overwrite)
    report_left_parts(leftover_parts(out))
    frames = _frames(video, size, fps, stream)
    named = None if names is None else words(names)
    annotations = read_annotations(results, frames.size_wh, frames.fps, named)
    write_exports(annotations, out, to, frames.name, overwrite=overwrite)
    print(
        f"{results}: {len(annotations.tracks())} targets in {annotations.frame_count} frames, "
        f"written to {out}",
        file=sys.stderr if is_stream(out) else sys.stdout,  # the output may be standard output
    )
    fps_of_numbers = timeline(annotations).fps
    if to == "labelstudio" and fps_of_numbers != annotations.fps:
        print(
            f'  the frame rate is variable: set framerate="{float(fps_of_numbers):g}" '
            "in Label Studio's tag Video"
        )


@dataclass(frozen=True)
class _Frames:
    """What formats tell of a video."""

    size_wh: tuple[int, int]
    fps: Fraction
    name: str = "video.mp4"


def _frames(video: str | None, size: str | None, fps: str | None, stream: int | None) -> _Frames:
    if stream is not None and video is None:
        raise ArgumentError(f"--stream {stream} is one of a video: give --video too")
    if video is None and size is not None and fps is not None:
        return _Frames(_size(size), _rate(fps))
    if video is None or size is not None or fps is not None:
        raise ArgumentError("give either --video, or --size and --fps: --size 1280x720 --fps 30")
    with open_source(video, stream=stream) as frames:
        return _Frames(frames.size_wh, frames.fps, Path(frames.name).name)


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(number) for number in text.split("x"))
    except ValueError:
        raise ArgumentError(f"--size {text!r} is no size: give pixels, such as 1280x720") from None
    return width, height


def _rate(text: str) -> Fraction:
    try:
        return Fraction(text)
    except (ValueError, ZeroDivisionError):
        raise ArgumentError(
            f"--fps {text!r} is no frame rate: give frames a second, such as 30 or 30000/1001"
        ) from None
