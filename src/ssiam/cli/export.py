"""`ssiam export`: write results in the formats of annotation tools."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ssiam.cli.options import report_leftover_parts, split_words
from ssiam.errors import ArgumentError
from ssiam.exchange import CvatShape, ExportKind, read_annotations, timeline, write_exports
from ssiam.outputs import check_distinct, check_output, is_stream, leftover_parts
from ssiam.parsing import parse_rate
from ssiam.video import open_source
from ssiam.video.images import image_paths
from ssiam.video.source_files import check_distinct_from_source

_MAX_SIDE = 65535  # px of a frame, the limit of JPEG


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
    shape: CvatShape | None = None,
    start: int = 0,
    step: int = 1,
    overwrite: Annotated[bool, Parameter(negative=())] = False,
    stream: int | None = None,
    max_frames: int | None = None,
) -> None:
    """Export the results of ssiam track to the format of an annotation tool.

    The formats contain the frame size and frame rate of the video: give --video, or both --size and
    --fps.

    Parameters
    ----------
    results
        File written by ssiam track --results: .csv or .jsonl.
    to
        Format of --out. cvat: XML, "CVAT for video 1.1". coco: JSON. labelstudio: JSON of a task.
        labelstudio-brush: JSON of a task for each image, with masks. yolo: zip of labels. got10k:
        zip with one folder per target.
    out
        File to write.
    video
        The tracked video or folder of images, from which frame size, frame rate and the names of
        the images are read.
    size
        Width and height of the video's frames in pixels: 1280x720.
    fps
        Frames per second: 25, 29.97 or 30000/1001.
    names
        Comma-separated names of the targets, in order; by default target 1, target 2, ...
    shape
        For cvat: rotated (boxes, the default), upright (boxes), polygon or mask.
    start
        First frame that is exported, for tasks that begin later in the video.
    step
        Every how many frames are exported, for tasks with a frame step.
    stream
        Index of the tracked video stream of --video, from 0; by default the one with the most
        pixels.
    overwrite
        Replace an existing file; without this option ssiam does not start.
    max_frames
        Accept results up to this many frames. By default those of a few lines may not have
        frame numbers of hours, which would make files of a hundred times their size.
    """
    inputs = [("results", results)]
    if video is None:
        check_distinct([("--out", out)], inputs)
    else:
        check_distinct_from_source([("--out", out)], video, inputs)
    check_output(out, overwrite=overwrite)
    report_leftover_parts(leftover_parts(out))
    video_info = _video_info(video, size, fps, stream)
    target_names = None if names is None else split_words(names)
    annotations = replace(
        read_annotations(results, video_info.size_wh, video_info.fps, target_names, max_frames),
        image_names=video_info.image_names,
    ).every(start, step)
    needs_masks = to == "labelstudio-brush" or shape in ("polygon", "mask")
    if needs_masks and all(row.mask is None for row in annotations.rows):
        raise ArgumentError(
            f"{results} holds no masks: write them with ssiam track --masks --results {results}"
        )
    write_exports(annotations, out, to, video_info.name, overwrite=overwrite, shape=shape)
    print(
        f"{results}: {len(annotations.tracks())} targets in {len(annotations.frames)} frames, "
        f"written to {out}",
        file=sys.stderr if is_stream(out) else sys.stdout,  # the output may be standard output
    )
    timeline_fps = timeline(annotations).fps
    if to == "labelstudio" and timeline_fps != annotations.fps:
        print(
            f'  the frame rate is variable: set framerate="{float(timeline_fps):g}" '
            "in Label Studio's tag Video"
        )


@dataclass(frozen=True)
class _VideoInfo:
    """The properties of a video that the formats contain."""

    size_wh: tuple[int, int]
    fps: Fraction
    name: str = "video.mp4"
    image_names: tuple[str, ...] = ()


def _video_info(
    video: str | None, size: str | None, fps: str | None, stream: int | None
) -> _VideoInfo:
    if stream is not None and video is None:
        raise ArgumentError(f"--stream {stream} needs a video: give --video too")
    if video is None and size is not None and fps is not None:
        return _VideoInfo(_size(size), _rate(fps))
    if video is None or size is not None or fps is not None:
        raise ArgumentError("give either --video, or --size and --fps: --size 1280x720 --fps 30")
    with open_source(video, stream=stream) as frames:
        return _VideoInfo(
            frames.size_wh, frames.fps, Path(frames.name).name, _image_names(Path(video))
        )


def _image_names(video: Path) -> tuple[str, ...]:
    """The names of a folder's images, in the order of the frames; none for other sources."""
    return tuple(path.name for path in image_paths(video)) if video.is_dir() else ()


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(number) for number in text.split("x"))
        if max(abs(width), abs(height)) > _MAX_SIDE:
            raise ValueError
    except ValueError:
        raise ArgumentError(
            f"--size {text[:40]!r} is not a size: give pixels, such as 1280x720"
        ) from None
    return width, height


def _rate(text: str) -> Fraction:
    try:
        return parse_rate(text)
    except ValueError:
        raise ArgumentError(
            f"--fps {text[:40]!r} is not a frame rate: give frames per second, such as 30 or "
            "30000/1001"
        ) from None
