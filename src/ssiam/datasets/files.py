"""Files and folders of a dataset. Their content is not trusted: sizes and paths are checked."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath

from ssiam.errors import DatasetError
from ssiam.parsing import is_number_word
from ssiam.video.images import image_paths

# Bytes. The longest sequences in use, with 30,000 frames, need less than half.
_MAX_TEXT = 2 * 1024 * 1024
_MAX_NAME = 255  # characters of a file name, the limit of file systems

_LIST = "list.txt"
_IMAGE_FOLDERS = ("img", "imgs", "color")


def read_text(path: Path, max_bytes: int = _MAX_TEXT) -> str:
    """The text of a file, UTF-8.

    Raises
    ------
    DatasetError
        There is no such file, or it has more than `max_bytes` bytes.
    """
    if not path.is_file():
        raise DatasetError(f"{path}: there is no such file; get the dataset's annotations")
    with path.open("rb") as file:
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise DatasetError(f"{path}: has more than {max_bytes} bytes; get it again")
    return data.decode("utf-8-sig", errors="replace")


def inside(folder: Path, name: str, source: Path) -> Path:
    """The path `name` under `folder`.

    Raises
    ------
    DatasetError
        It leads out of the folder; the message names the file `source` that contains it.
    """
    parts = PurePosixPath(name.replace("\\", "/")).parts
    leads_out = not parts or ".." in parts or parts[0] == "/" or ":" in parts[0] or "\0" in name
    if leads_out or any(len(part) > _MAX_NAME for part in parts):
        raise DatasetError(f"{source}: {name[:60]!r} is not inside of {folder}; remove it")
    return folder.joinpath(*parts)


def subfolders(folder: Path) -> list[Path]:
    """Folders in `folder`: those in its list.txt, in that order, or all of them, sorted.

    Raises
    ------
    DatasetError
        list.txt is empty, or names a folder that is missing or outside of `folder`.
    """
    listed = folder / _LIST
    if not listed.is_file():
        return sorted(path for path in folder.iterdir() if _is_readable(path))
    names = dict.fromkeys(line.strip() for line in read_text(listed).splitlines() if line.strip())
    folders = [inside(folder, name, listed) for name in names]
    for path in folders:
        if not path.is_dir():
            raise DatasetError(f"{listed}: names {path.name!r}, but there is no such folder")
    if not folders:
        raise DatasetError(f"{listed}: names no sequence; fill it or remove it")
    return folders


def _is_readable(path: Path) -> bool:
    """Whether a path is a readable, visible folder; lost+found is not readable."""
    return path.is_dir() and not path.name.startswith(".") and os.access(path, os.R_OK | os.X_OK)


def image_folder(folder: Path) -> Path:
    """The folder of a sequence's frames: its img, imgs or color, else the folder itself."""
    inner = (folder / name for name in _IMAGE_FOLDERS)
    return next((path for path in inner if path.is_dir()), folder)


def images_in(folder: Path) -> tuple[Path, ...]:
    """The images of a folder in natural order; `DatasetError` if it has none."""
    found = tuple(image_paths(folder)) if folder.is_dir() else ()
    if not found:
        raise DatasetError(f"{folder}: has no images; get the frames of the dataset")
    return found


def numbered(images: tuple[Path, ...]) -> dict[int, Path]:
    """Images by number (00042.jpg: 42), without those that have other names."""
    with_number = (path for path in images if is_number_word(path.stem))
    return {int(path.stem): path for path in with_number}


def named_like(folder: Path) -> Path | None:
    """The box file with the name, or the end of the name, of its folder: uav123_bike1/bike1.txt."""
    found = (
        path
        for path in sorted(folder.glob("*.txt"))
        if f"_{folder.name}".endswith(f"_{path.stem}") and path.is_file()
    )
    return next(found, None)


def check_counts(
    where: Path | str, frames: int, boxes: int, *, one_is_enough: bool = False
) -> None:
    """Raise `DatasetError` unless there is a box for every frame, or one if `one_is_enough`."""
    if frames != boxes and not (one_is_enough and boxes == 1):
        raise DatasetError(
            f"{where}: {frames} images but {boxes} boxes; the dataset is incomplete, get it again"
        )


def frames_by_number(
    folder: Path, by_number: dict[int, Path], first: int, count: int
) -> tuple[Path, ...]:
    """The `count` images from number `first` on; `DatasetError` if one is missing."""
    wanted = range(first, first + count)
    missing = [number for number in wanted if number not in by_number]
    if missing:
        raise DatasetError(
            f"{folder}: frames {first} to {wanted[-1]} have boxes, but the images of {len(missing)}"
            f" of them are missing, from {missing[0]} on; get them again"
        )
    return tuple(by_number[number] for number in wanted)
