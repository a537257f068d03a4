"""Folders of pictures, and the files that belong to them by their names."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from ssiam.datasets import DatasetError
from ssiam.video.images import IMAGE_SUFFIXES


def first_folder(root: Path, names: Sequence[str]) -> Path:
    """The first of the folders `names` that is in `root`, links followed.

    Raises
    ------
    DatasetError
        None of them is there; the message lists them.
    """
    found = next((root / name for name in names if (root / name).is_dir()), None)
    if found is None:
        raise DatasetError(f"{root}: holds no folder {' or '.join(names)}; check the path")
    return found.resolve()


def files_below(folder: Path, suffixes: Iterable[str]) -> list[Path]:
    """All files in `folder` and the folders in it with one of the `suffixes`, by path.

    The paths are those without links, so that one picture has one path.

    Raises
    ------
    DatasetError
        There is no such folder, or it holds none.
    """
    if not folder.is_dir():
        raise DatasetError(f"{folder}: there is no such folder; check the path")
    wanted = tuple(suffixes)
    found = sorted(
        os.path.join(where, name)
        for where, _, names in os.walk(folder.resolve())
        for name in names
        if name.lower().endswith(wanted) and not name.startswith(".")
    )
    if not found:
        raise DatasetError(f"{folder}: holds no {' or '.join(wanted)}; get the set again")
    return [Path(path) for path in found]


def pictures_below(folder: Path) -> list[Path]:
    """All pictures in `folder` and the folders in it; `DatasetError` if there are none."""
    return files_below(folder, sorted(IMAGE_SUFFIXES))


def by_stem(folder: Path) -> dict[str, Path]:
    """The pictures of a folder by their path in it without the suffix: train/0001."""
    resolved = folder.resolve()
    return {stem_in(resolved, path): path for path in pictures_below(resolved)}


def stem_in(folder: Path, path: Path) -> str:
    """Path of a file in `folder`, with slashes and without the suffix; neither has links."""
    # Not `relative_to`, which takes as long as reading a small file.
    inner = str(path).removeprefix(str(folder)).lstrip(os.sep)
    return os.path.splitext(inner)[0].replace(os.sep, "/")
