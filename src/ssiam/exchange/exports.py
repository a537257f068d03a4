"""`write_exports`: annotations in the formats of annotation tools."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal, TypeAlias

from ssiam.errors import check_choice
from ssiam.exchange.annotations import Annotations, printable
from ssiam.exchange.coco import write_coco
from ssiam.exchange.cvat import write_cvat
from ssiam.exchange.got10k import write_got10k
from ssiam.exchange.labelstudio import write_labelstudio

ExportKind: TypeAlias = Literal["cvat", "coco", "labelstudio", "got10k"]

EXPORT_KINDS: Final[tuple[ExportKind, ...]] = ("cvat", "coco", "labelstudio", "got10k")

_WRITERS: Final[dict[ExportKind, Callable[[Annotations, Path, str, bool], None]]] = {
    "cvat": write_cvat,
    "coco": write_coco,
    "labelstudio": write_labelstudio,
    "got10k": write_got10k,
}


def write_exports(
    annotations: Annotations,
    path: str | Path,
    kind: ExportKind,
    video: str = "video.mp4",
    *,
    overwrite: bool = True,
) -> None:
    """Write `annotations` to the file `path`, completely or not at all.

    Equal annotations give equal bytes.

    Parameters
    ----------
    annotations : Annotations
    path : str or Path
        Its folder must exist.
    kind : {"cvat", "coco", "labelstudio", "got10k"}
        XML of "CVAT for video 1.1", JSON of COCO, JSON of Label Studio's tasks, or a zip with
        one folder per target as in GOT-10k. docs/how-to/exchange.md describes their contents.
    video : str
        The video's name or address, for formats that contain it.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    SinkError
        The file cannot be written, or exists and `overwrite` is False.
    ArgumentError
        The kind is unknown.
    """
    write = _WRITERS[check_choice("kind of export", kind, EXPORT_KINDS)]
    write(annotations, Path(path), printable(video), overwrite)
