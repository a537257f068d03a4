"""Finding the files of a training set, and skipping damaged annotations."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from ssiam.datasets import DatasetError
from ssiam.errors import SsiamError
from ssiam.video.images import IMAGE_SUFFIXES

__all__ = ["AnnotationErrors", "first_folder", "images_by_stem", "list_files", "relative_stem"]

_log = logging.getLogger(__name__)

# Fraction of damaged annotations above which a set is rejected: it probably has another layout.
_MAX_DAMAGED: Final = 0.1


def first_folder(root: Path, names: Sequence[str]) -> Path:
    """The first of the folders `names` that exists in `root`, with links resolved.

    Raises
    ------
    DatasetError
        None of them exists; the message lists them.
    """
    found = next((root / name for name in names if (root / name).is_dir()), None)
    if found is None:
        raise DatasetError(f"{root}: holds no folder {' or '.join(names)}; check the path")
    return found.resolve()


def list_files(folder: Path, suffixes: Iterable[str]) -> list[Path]:
    """All files in `folder` and its subfolders with one of the `suffixes`, sorted by path.

    The folder's links are resolved, so that one image has one path.

    Raises
    ------
    DatasetError
        The folder does not exist, or holds no such file.
    """
    if not folder.is_dir():
        raise DatasetError(f"{folder}: there is no such folder; check the path")
    wanted = tuple(suffixes)
    found = sorted(
        os.path.join(parent, name)
        for parent, _, names in os.walk(folder.resolve())
        for name in names
        if name.lower().endswith(wanted) and not name.startswith(".")
    )
    if not found:
        raise DatasetError(f"{folder}: holds no {' or '.join(wanted)}; get the set again")
    return [Path(path) for path in found]


def images_by_stem(folder: Path) -> dict[str, Path]:
    """The images in a folder and its subfolders by relative path without suffix: train/0001.

    Raises
    ------
    DatasetError
        The folder does not exist, or holds no image.
    """
    resolved = folder.resolve()
    images = list_files(resolved, sorted(IMAGE_SUFFIXES))
    return {relative_stem(resolved, path): path for path in images}


def relative_stem(folder: Path, path: Path) -> str:
    """Path of a file relative to `folder`, with slashes and without suffix; both resolved."""
    # `Path.relative_to` takes as long as reading a small file.
    inner = str(path).removeprefix(str(folder)).lstrip(os.sep)
    return os.path.splitext(inner)[0].replace(os.sep, "/")


class AnnotationErrors:
    """Skips and counts the damaged annotations of a set.

    Up to a tenth of the annotations are skipped with one warning. If more are damaged, `check`
    rejects the set.

    Parameters
    ----------
    folder : Path
        Folder of the set, for messages.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._tried = 0
        self._errors: list[str] = []

    @contextmanager
    def skip(self) -> Iterator[None]:
        """A context for reading one annotation; a `SsiamError` in it is counted."""
        self._tried += 1
        try:
            yield
        except SsiamError as error:
            self._errors.append(str(error))

    def check(self) -> None:
        """Warn about skipped annotations; `DatasetError` if they are more than a tenth."""
        count = len(self._errors)
        if not count:
            return
        summary = f"{count} of {self._tried} annotations cannot be read, first: {self._errors[0]}"
        if count > _MAX_DAMAGED * self._tried:
            raise DatasetError(f"{self._folder}: {summary}")
        _log.warning("%s: %s; left out", self._folder, summary)
