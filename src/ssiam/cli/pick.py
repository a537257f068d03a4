"""`ssiam track --pick`: a frame with numbered proposals as an image, and what to type."""

from __future__ import annotations

import shlex
from collections.abc import Generator, Iterable, Sequence
from itertools import chain
from pathlib import Path

import cv2

from ssiam.cli.moments import Span
from ssiam.cli.static_areas import StaticAreas
from ssiam.cli.track_run import SourceOptions, selected_frames
from ssiam.errors import SinkError
from ssiam.geometry import XYWH, Image
from ssiam.motion.proposals import propose_boxes
from ssiam.outputs import atomic_write, check_output, numbered_names
from ssiam.track import Track
from ssiam.video import Frame
from ssiam.video.drawing import draw_rulers, draw_tracks
from ssiam.video.source_files import check_distinct_from_source


def pick_boxes(
    source: SourceOptions, span: Span, areas: StaticAreas, stem: str, words: Sequence[str]
) -> None:
    """Write the first frame of `span` with numbered proposals; print the commands to type.

    Parameters
    ----------
    source : SourceOptions
    span : Span
    areas : StaticAreas
        What moves with the camera, and is not proposed.
    stem : str
        The image is called STEM-pick.png, numbered to be unused.
    words : sequence of str
        The command, to which each proposal adds its ``--box``.

    Raises
    ------
    SsiamError
        The source cannot be opened, has no frame in the span, an area does not fit it, or the image
        cannot be written.
    """
    paths = (Path(f"{name}.png") for name in numbered_names(f"{stem}-pick"))
    path = next(path for path in paths if not path.exists())
    check_distinct_from_source([("--pick", path)], source.spec)
    check_output(path, overwrite=False)
    with source.open() as frames:
        static = areas.mask(frames.size_wh)
        frame, boxes = _proposals(selected_frames(frames, span, ()), static)
    _write(path, draw_proposals(frame.image, boxes))
    found = f"{len(boxes)} proposals" if boxes else "no proposal: nothing stands out"
    print(f"{path}: frame {frame.index} with {found}. To track one of them, type its line:")
    for number, box in enumerate(boxes, 1):
        print(f"  {_command(words, box)}  # {number}")
    print("Several: one --box each. Another target: read its box off the rulers of the image:")
    print(f"  {shlex.join(words)} --box x,y,width,height")


def draw_proposals(image: Image, boxes: Iterable[XYWH]) -> Image:
    """A copy of the frame with rulers in pixels and a number on each box, from 1."""
    tracks = [Track(box) for box in boxes]
    numbers = range(1, len(tracks) + 1)
    return draw_tracks(
        draw_rulers(image), tracks, numbers=numbers, labels=[str(n) for n in numbers]
    )


def _proposals(
    frames: Generator[Frame, None, None], static: Image | None
) -> tuple[Frame, list[XYWH]]:
    first = next(frames)
    return first, propose_boxes(chain([first.image], (frame.image for frame in frames)), static)


def _command(words: Sequence[str], box: XYWH) -> str:
    return shlex.join([*words, "--box", ",".join(f"{value:g}" for value in box)])


def _write(path: Path, image: Image) -> None:
    is_encoded, data = cv2.imencode(".png", image)
    if not is_encoded:
        raise SinkError(f"{path}: cannot be written (the image cannot be encoded)")
    with atomic_write(path, "wb", overwrite=False) as file:
        file.write(data.tobytes())
