"""CVAT: XML of the format "CVAT for video 1.1", one track per target, written and read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args
from xml.etree import ElementTree
from xml.sax.saxutils import XMLGenerator

import numpy as np

from ssiam.errors import AnnotationsError
from ssiam.exchange.annotations import (
    Annotation,
    Annotations,
    RotatedBox,
    annotation_from_rotated_box,
    full_circle,
    rotated_box,
    rounded,
    visible_runs,
)
from ssiam.exchange.mask_shapes import CvatMask, cvat_mask, mask_of, polygon
from ssiam.exchange.tool_files import finite, read_file, whole
from ssiam.geometry import corners_from_xywh, xywh_from_corners
from ssiam.outputs import atomic_write

CvatShape: TypeAlias = Literal["rotated", "upright", "polygon", "mask"]
CVAT_SHAPES: Final[tuple[CvatShape, ...]] = get_args(CvatShape)

_READ_SHAPES: Final = ("box", "polygon")


def write_cvat(
    annotations: Annotations,
    path: Path,
    video: str,
    overwrite: bool = True,
    shape: CvatShape = "rotated",
) -> None:
    """Write a file for CVAT's import "CVAT 1.1", every shape a keyframe; raises as `write_exports`.

    CVAT displays a shape until the next keyframe. Where a target is lost or has no row, one shape
    with ``outside="1"`` at its last visible position ends the display. Rotated boxes are rotated
    about their center, as in CVAT. Frames have their numbers in the video, as in CVAT's own files.

    Parameters
    ----------
    annotations, path, video, overwrite
        As for `write_exports`.
    shape : {"rotated", "upright", "polygon", "mask"}
        Boxes; or the outline or the pixels of the mask, where a target has one, and else its
        upright box as a polygon or mask. CVAT has no tracks of masks: each is a track of one frame.
    """
    with atomic_write(path, "w", overwrite=overwrite) as file:
        xml = XMLGenerator(file, encoding="utf-8", short_empty_elements=True)
        xml.startDocument()
        with _element(xml, "annotations"):
            _text(xml, "version", "1.1")
            with _element(xml, "meta"), _element(xml, "task"):
                _write_task(xml, annotations, video)
            for target, rows in annotations.tracks().items():
                runs = list(visible_runs(rows, annotations.step))
                if shape == "mask":
                    runs = [[row] for run in runs for row in run]
                    for run in runs:
                        _write_track(xml, annotations, target, [run], shape)
                else:
                    _write_track(xml, annotations, target, runs, shape)
        xml.endDocument()


def _write_task(xml: XMLGenerator, annotations: Annotations, video: str) -> None:
    _text(xml, "name", video)
    _text(xml, "size", str(len(annotations.frames)))
    _text(xml, "mode", "interpolation")
    _text(xml, "overlap", "0")
    if annotations.start or annotations.step > 1:
        _text(xml, "start_frame", str(annotations.start))
        _text(xml, "stop_frame", str(annotations.frame_count - 1))
        _text(xml, "frame_filter", f"step={annotations.step}")
    with _element(xml, "labels"):
        for name in dict.fromkeys(map(annotations.name, annotations.tracks())):
            with _element(xml, "label"):
                _text(xml, "name", name)
                _text(xml, "attributes", "")
    with _element(xml, "original_size"):
        _text(xml, "width", str(annotations.size_wh[0]))
        _text(xml, "height", str(annotations.size_wh[1]))
    _text(xml, "source", video)


def _write_track(
    xml: XMLGenerator,
    annotations: Annotations,
    target: int,
    runs: list[list[Annotation]],
    shape: CvatShape,
) -> None:
    if not runs:
        return
    attributes = {"id": str(target), "label": annotations.name(target), "source": "auto"}
    with _element(xml, "track", attributes):
        for run in runs:
            for row in run:
                _write_shape(xml, annotations, row, row.frame, shape, outside=False)
            after = run[-1].frame + annotations.step
            if after in annotations.frames:
                _write_shape(xml, annotations, run[-1], after, shape, outside=True)


def _write_shape(
    xml: XMLGenerator,
    annotations: Annotations,
    row: Annotation,
    frame: int,
    shape: CvatShape,
    *,
    outside: bool,
) -> None:
    attributes = {"frame": str(frame), "outside": str(int(outside)), "occluded": "0"}
    attributes["keyframe"] = "1"
    name = "box"
    if shape == "polygon":
        name = "polygon"
        attributes["points"] = _points(row, annotations.size_wh)
    elif shape == "mask":
        name = "mask"
        mask = _mask(row, annotations.size_wh)
        attributes["rle"] = ", ".join(map(str, mask.runs))
        attributes |= {key: str(getattr(mask, key)) for key in ("left", "top", "width", "height")}
    else:
        attributes |= _sides(row, is_rotated=shape == "rotated")
    attributes["z_order"] = "0"
    with _element(xml, name, attributes):
        pass


def _sides(row: Annotation, *, is_rotated: bool) -> dict[str, str]:
    box = rotated_box(row) if is_rotated else rotated_box(replace(row, corners=None))
    left, top = box.upright_xy
    sides = rounded((left, top, left + box.w, top + box.h))
    attributes = dict(zip(("xtl", "ytl", "xbr", "ybr"), map(str, sides), strict=True))
    if is_rotated and row.corners is not None:
        attributes["rotation"] = str(full_circle(box.degrees))
    return attributes


def _points(row: Annotation, size_wh: tuple[int, int]) -> str:
    mask = mask_of(row, size_wh)
    outline = None if mask is None else polygon(mask)
    corners = corners_from_xywh(row.xywh).tolist() if outline is None else outline
    return ";".join(",".join(f"{value:.2f}" for value in rounded(point, 2)) for point in corners)


def _mask(row: Annotation, size_wh: tuple[int, int]) -> CvatMask:
    mask = mask_of(row, size_wh)
    if mask is None:
        width, height = size_wh
        x, y, w, h = row.xywh
        mask = np.zeros((height, width), dtype=np.bool_)
        left, top = (min(max(int(v), 0), n - 1) for v, n in ((x, width), (y, height)))
        mask[top : max(math.ceil(y + h), top + 1), left : max(math.ceil(x + w), left + 1)] = True
    return cvat_mask(mask)


@contextmanager
def _element(
    xml: XMLGenerator, name: str, attributes: dict[str, str] | None = None
) -> Iterator[None]:
    xml.startElement(name, attributes or {})  # type: ignore[arg-type]
    yield
    xml.endElement(name)
    xml.ignorableWhitespace("\n")


def _text(xml: XMLGenerator, name: str, text: str) -> None:
    with _element(xml, name):
        xml.characters(text)


def read_cvat(path: Path, size_wh: tuple[int, int], fps: float | Fraction) -> Annotations:
    """Read the tracks of a file of "CVAT for video 1.1".

    Targets are numbered from 1 in the order of the tracks' ids. A box with ``outside="1"`` is a row
    that is lost. Polygons are read as the upright box around them.

    Raises
    ------
    AnnotationsError
        The file cannot be read, is of another kind, or has a value that is not possible.
    """
    root = _parsed(path)
    tracks = root.findall("track")
    if root.tag != "annotations" or (not tracks and root.find("image") is not None):
        raise AnnotationsError(f'{path}: is not a file of "CVAT for video 1.1": export that format')
    ordered = sorted(tracks, key=lambda track: whole(path, "id of a track", track.get("id")))
    rows: dict[tuple[int, int], Annotation] = {}
    names: list[str] = []
    for target, track in enumerate(ordered, 1):
        names.append(track.get("label") or f"target {target}")
        for shape in track:
            if shape.tag not in _READ_SHAPES:
                raise AnnotationsError(
                    f"{path}: track {track.get('id')} has the shape {shape.tag!r}: only rectangles "
                    "and polygons are read"
                )
            row = _row(path, target, shape)
            if rows.setdefault((row.frame, target), row) is not row:
                raise AnnotationsError(
                    f"{path}: track {track.get('id')} is in frame {row.frame} a second time"
                )
    return Annotations(size_wh, fps, tuple(names), tuple(rows.values()))


def _parsed(path: Path) -> ElementTree.Element:
    content = read_file(path)
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise AnnotationsError(f"{path}: declares a document type, which CVAT never writes")
    try:
        return ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # unknown encodings
        raise AnnotationsError(f"{path}: is not XML ({error}); is it cut off?") from None


def _row(path: Path, target: int, shape: ElementTree.Element) -> Annotation:
    values: Mapping[str, str] = shape.attrib
    frame = whole(path, "frame", values.get("frame"))
    lost, keyframe = values.get("outside") == "1", values.get("keyframe", "1") == "1"
    if shape.tag == "polygon":
        points = [pair.split(",") for pair in values.get("points", "").split(";")]
        if any(len(point) != 2 for point in points):
            raise AnnotationsError(f"{path}: frame {frame}: points of a polygon are not x,y;x,y")
        corners = [[finite(path, "points", value) for value in point] for point in points]
        xywh = xywh_from_corners(corners)
        return Annotation(frame, None, target, xywh, lost=lost, keyframe=keyframe)
    left, top, right, bottom = (
        finite(path, name, values.get(name)) for name in ("xtl", "ytl", "xbr", "ybr")
    )
    degrees = finite(path, "rotation", values.get("rotation", "0"))
    box = RotatedBox((left + right) / 2, (top + bottom) / 2, right - left, bottom - top, degrees)
    if box.w <= 0 or box.h <= 0:
        raise AnnotationsError(f"{path}: frame {frame}: the box {box.w:g}x{box.h:g} is empty")
    return annotation_from_rotated_box(frame, None, target, box, lost=lost, keyframe=keyframe)
