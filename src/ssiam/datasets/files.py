"""Files and folders of a dataset. What they hold is not trusted: sizes and paths have limits."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath

from ssiam.errors import DatasetError
from ssiam.video.folders import image_paths

# Bytes. The longest sequences in use have 30,000 frames and take less than half of it.
_LARGEST_TEXT = 2 * 1024 * 1024
# Characters of a file name, as file systems have it.
_LONGEST_NAME = 255

_LIST = "list.txt"
_IMAGE_FOLDERS = ("img", "imgs", "color")


def read_text(path: Path, largest: int = _LARGEST_TEXT) -> str:
    """The text of a file; `DatasetError` if it is no file or has more than `largest` bytes."""
    if not path.is_file():
        raise DatasetError(f"{path}: there is no such file; get the dataset's annotations")
    with path.open("rb") as file:
        data = file.read(largest + 1)
    if len(data) > largest:
        raise DatasetError(f"{path}: has more than {largest} bytes, too many for what it should be")
    return data.decode("utf-8-sig", errors="replace")


def inside(folder: Path, name: str, source: Path) -> Path:
    """The path `name` under `folder`, as the file `source` tells it; refused if it leads out."""
    parts = PurePosixPath(name.replace("\\", "/")).parts
    leads_out = not parts or ".." in parts or parts[0] == "/" or ":" in parts[0] or "\0" in name
    if leads_out or any(len(part) > _LONGEST_NAME for part in parts):
        raise DatasetError(f"{source}: {name[:60]!r} does not lie inside of {folder}; remove it")
    return folder.joinpath(*parts)


def subfolders(folder: Path) -> list[Path]:
    """Folders in `folder`: those that its list.txt names, in that order, or else all by name."""
    listed = folder / _LIST
    if not listed.is_file():
        return sorted(path for path in folder.iterdir() if _is_open(path))
    names = dict.fromkeys(line.strip() for line in read_text(listed).splitlines() if line.strip())
    folders = [inside(folder, name, listed) for name in names]
    for path in folders:
        if not path.is_dir():
            raise DatasetError(f"{listed}: names {path.name!r}, which is no folder beside it")
    if not folders:
        raise DatasetError(f"{listed}: names no sequence; fill it or remove it")
    return folders


def _is_open(path: Path) -> bool:
    """Whether a path is a folder that may be looked into, which lost+found is not."""
    return path.is_dir() and not path.name.startswith(".") and os.access(path, os.R_OK | os.X_OK)


def image_folder(folder: Path) -> Path:
    """Where the frames of a sequence lie: its img, imgs or color, or the folder itself."""
    inner = (folder / name for name in _IMAGE_FOLDERS)
    return next((path for path in inner if path.is_dir()), folder)


def images_in(folder: Path) -> tuple[Path, ...]:
    """The images of a folder in natural order; `DatasetError` if there are none."""
    found = tuple(image_paths(folder)) if folder.is_dir() else ()
    if not found:
        raise DatasetError(f"{folder}: holds no images; get the frames of the dataset")
    return found


def numbered(images: tuple[Path, ...]) -> dict[int, Path]:
    """Images by the number that is their name (00042.jpg: 42); others are left out."""
    plain = (path for path in images if path.stem.isascii() and path.stem.isdigit())
    return {int(path.stem): path for path in plain}


def named_like(folder: Path) -> Path | None:
    """The box file that carries the end of its folder's name: uav123_bike1 holds bike1.txt."""
    found = (
        path
        for path in sorted(folder.glob("*.txt"))
        if f"_{folder.name}".endswith(f"_{path.stem}") and path.is_file()
    )
    return next(found, None)


def check_counts(
    where: Path | str, frames: int, boxes: int, *, one_is_enough: bool = False
) -> None:
    """Raise `DatasetError` unless there is a box for every frame, or one if that is enough."""
    if frames != boxes and not (one_is_enough and boxes == 1):
        raise DatasetError(
            f"{where}: {frames} images but {boxes} boxes; one of them is not whole, get it again"
        )


def frames_by_number(
    folder: Path, by_number: dict[int, Path], first: int, count: int
) -> tuple[Path, ...]:
    """The images numbered `first` and the `count` - 1 after it; `DatasetError` names a missing."""
    wanted = range(first, first + count)
    missing = [number for number in wanted if number not in by_number]
    if missing:
        raise DatasetError(
            f"{folder}: frames {first} to {wanted[-1]} have boxes, but the images of {len(missing)}"
            f" of them are missing, from {missing[0]} on; get them again"
        )
    return tuple(by_number[number] for number in wanted)
