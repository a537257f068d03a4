"""`write_exports`: annotations in the formats of annotation tools."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

from ssiam.errors import ArgumentError, check_choice
from ssiam.exchange.annotations import Annotations, printable
from ssiam.exchange.brush import write_brush
from ssiam.exchange.coco import write_coco
from ssiam.exchange.cvat import CVAT_SHAPES, CvatShape, write_cvat
from ssiam.exchange.got10k import write_got10k
from ssiam.exchange.labelstudio import write_labelstudio
from ssiam.exchange.yolo import write_yolo

ExportKind: TypeAlias = Literal[
    "cvat", "coco", "labelstudio", "labelstudio-brush", "yolo", "got10k"
]

EXPORT_KINDS: Final[tuple[ExportKind, ...]] = get_args(ExportKind)

_WRITERS: Final[dict[ExportKind, Callable[[Annotations, Path, str, bool], None]]] = {
    "cvat": write_cvat,
    "coco": write_coco,
    "labelstudio": write_labelstudio,
    "labelstudio-brush": write_brush,
    "yolo": write_yolo,
    "got10k": write_got10k,
}


def write_exports(
    annotations: Annotations,
    path: str | Path,
    kind: ExportKind,
    video: str = "video.mp4",
    *,
    overwrite: bool = True,
    shape: CvatShape | None = None,
) -> None:
    """Write `annotations` to the file `path`, completely or not at all.

    Equal annotations give equal bytes.

    Parameters
    ----------
    annotations : Annotations
    path : str or Path
        Its folder must exist.
    kind : {"cvat", "coco", "labelstudio", "labelstudio-brush", "yolo", "got10k"}
        XML of "CVAT for video 1.1", JSON of COCO, JSON of Label Studio's tasks of a video or of
        images, a zip of YOLO's labels, or a zip with one folder per target as in GOT-10k.
        docs/how-to/exchange.md describes their contents.
    video : str
        The video's name or address, for formats that contain it.
    overwrite : bool
        Whether an existing file may be replaced.
    shape : {"rotated", "upright", "polygon", "mask"}, optional
        For "cvat": see `ssiam.exchange.cvat.write_cvat`.

    Raises
    ------
    SinkError
        The file cannot be written, or exists and `overwrite` is False.
    ArgumentError
        The kind is unknown, or a shape is given for another kind than "cvat".
    """
    write = _WRITERS[check_choice("kind of export", kind, EXPORT_KINDS)]
    name = printable(video)
    if shape is not None:
        if kind != "cvat":
            raise ArgumentError(f"a shape is chosen for cvat alone: omit {shape} for {kind}")
        check_choice("shape", shape, CVAT_SHAPES)
        write_cvat(annotations, Path(path), name, overwrite, shape)
        return
    write(annotations, Path(path), name, overwrite)
