"""GOT-10k: a zip with one folder per target, with the label files that its toolkit reads."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final
from zipfile import ZIP_DEFLATED, ZipFile

from ssiam.exchange.annotations import NO_BOX, Annotation, Annotations
from ssiam.exchange.zip_entries import add_text
from ssiam.outputs import atomic_write

_LIST: Final = "list.txt"
_LONGEST_NAME: Final = 60  # characters, up to four bytes each; file systems allow 255 bytes
_NOT_IN_NAMES: Final = re.compile(r"[^\w.-]+")
# Values of cover.label: from hidden to completely visible.
_HIDDEN, _VISIBLE = 0, 8


def write_got10k(annotations: Annotations, path: Path, video: str, overwrite: bool = True) -> None:
    """Write the zip; raises as `write_exports`.

    Every file has one line per annotated frame of the video, in 0-based pixels as in GOT-10k's
    toolkit. Where a target is not visible its box is ``0,0,0,0`` and absence.label is 1. Rotated
    boxes are written as their upright box. Unknown fields of meta_info.ini are "none".
    """
    tracks = annotations.tracks()
    folders = list(_folders([annotations.name(target) for target in tracks]))
    with (
        atomic_write(path, "wb", overwrite=overwrite) as file,
        ZipFile(file, "w", ZIP_DEFLATED) as archive,
    ):
        add_text(archive, _LIST, folders)
        for folder, (target, rows) in zip(folders, tracks.items(), strict=True):
            for name, lines in _files(annotations, annotations.name(target), rows, video):
                add_text(archive, f"{folder}/{name}", lines)


def _folders(names: Sequence[str]) -> Iterator[str]:
    """Unique names that every file system accepts."""
    taken = {_LIST}
    for name in names:
        plain = _NOT_IN_NAMES.sub("_", name)[:_LONGEST_NAME].strip("._") or "target"
        folder, number = plain, 1
        while folder.casefold() in taken:
            number += 1
            folder = f"{plain}_{number}"
        taken.add(folder.casefold())
        yield folder


def _files(
    annotations: Annotations, name: str, rows: Sequence[Annotation], video: str
) -> Iterator[tuple[str, list[str]]]:
    visible = {row.frame: row.xywh for row in rows if row.visible}
    frames = annotations.frames
    yield "groundtruth.txt", [_line(visible.get(frame, NO_BOX)) for frame in frames]
    yield "absence.label", [str(int(frame not in visible)) for frame in frames]
    yield "cover.label", [str(_VISIBLE if frame in visible else _HIDDEN) for frame in frames]
    cut = {frame for frame, xywh in visible.items() if _is_cut(xywh, annotations.size_wh)}
    yield "cut_by_image.label", [str(int(frame in cut)) for frame in frames]
    yield "meta_info.ini", _meta(annotations, name, video)


def _line(xywh: Sequence[float]) -> str:
    return ",".join(f"{value:.4f}" for value in xywh)


def _is_cut(xywh: Sequence[float], size_wh: tuple[int, int]) -> bool:
    x, y, w, h = xywh
    return x < 0 or y < 0 or x + w > size_wh[0] or y + h > size_wh[1]


def _meta(annotations: Annotations, name: str, video: str) -> list[str]:
    """Lines in the order of GOT-10k's own files: some readers rely on it."""
    width, height = annotations.size_wh
    values = {
        "url": video,
        "begin": _clock(float(annotations.start / annotations.fps)),
        "end": _clock(float(annotations.frame_count / annotations.fps)),
        "anno_fps": f"{float(annotations.fps / annotations.step):g}Hz",
        "object_class": name,
        **dict.fromkeys(("motion_class", "major_class", "root_class", "motion_adverb"), "none"),
        "resolution": f"({width}, {height})",
    }
    return ["[METAINFO]", *(f"{key}: {value}" for key, value in values.items())]


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest:02d}"
