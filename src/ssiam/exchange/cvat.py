"""CVAT: XML of the format "CVAT for video 1.1", one track per target."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.sax.saxutils import XMLGenerator

from ssiam.exchange.annotations import (
    Annotation,
    Annotations,
    full_circle,
    rotated_box,
    rounded,
    visible_runs,
)
from ssiam.outputs import atomic_write


def write_cvat(annotations: Annotations, path: Path, video: str, overwrite: bool = True) -> None:
    """Write a file for CVAT's import "CVAT 1.1", every box a keyframe; raises as `write_exports`.

    CVAT displays a box until the next keyframe. Where a target is lost or has no row, one box with
    ``outside="1"`` at its last visible position ends the display. Rotated boxes are rotated about
    their center, as in CVAT.
    """
    with atomic_write(path, "w", overwrite=overwrite) as file:
        xml = XMLGenerator(file, encoding="utf-8", short_empty_elements=True)
        xml.startDocument()
        with _element(xml, "annotations"):
            _text(xml, "version", "1.1")
            with _element(xml, "meta"), _element(xml, "task"):
                _write_task(xml, annotations, video)
            for target, rows in annotations.tracks().items():
                _write_track(xml, annotations, target, list(visible_runs(rows)))
        xml.endDocument()


def _write_task(xml: XMLGenerator, annotations: Annotations, video: str) -> None:
    _text(xml, "name", video)
    _text(xml, "size", str(annotations.frame_count))
    _text(xml, "mode", "interpolation")
    _text(xml, "overlap", "0")
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
    xml: XMLGenerator, annotations: Annotations, target: int, runs: list[list[Annotation]]
) -> None:
    if not runs:
        return
    attributes = {"id": str(target), "label": annotations.name(target), "source": "auto"}
    with _element(xml, "track", attributes):
        for run in runs:
            for row in run:
                _write_box(xml, row, row.frame, outside=False)
            after = run[-1].frame + 1
            if after < annotations.frame_count:
                _write_box(xml, run[-1], after, outside=True)


def _write_box(xml: XMLGenerator, row: Annotation, frame: int, *, outside: bool) -> None:
    box = rotated_box(row)
    left, top = box.upright_xy
    sides = rounded((left, top, left + box.w, top + box.h))
    attributes = {"frame": str(frame), "outside": str(int(outside)), "occluded": "0"}
    attributes["keyframe"] = "1"
    attributes |= dict(zip(("xtl", "ytl", "xbr", "ybr"), map(str, sides), strict=True))
    if row.corners is not None:
        attributes["rotation"] = str(full_circle(box.degrees))
    attributes["z_order"] = "0"
    with _element(xml, "box", attributes):
        pass


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
