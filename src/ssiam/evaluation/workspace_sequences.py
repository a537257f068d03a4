"""The sequences of a workspace: folders in VOT's layout, and the list by which they are found."""

from __future__ import annotations

from pathlib import Path

from ssiam.datasets.files import read_text
from ssiam.errors import DatasetError

LIST = "list.txt"
_TRUTH = "groundtruth.txt"


def sequence_folders(source: Path) -> list[Path]:
    """The sequences in a folder: those of its list.txt, or every folder with a groundtruth.txt.

    Raises
    ------
    DatasetError
        There are none, or one of the list is not there.
    """
    listed = source / LIST
    if listed.is_file():
        folders = [source / name.strip() for name in read_text(listed).splitlines() if name.strip()]
    elif source.is_dir():
        folders = sorted(path.parent for path in source.glob(f"*/{_TRUTH}"))
    else:
        raise DatasetError(f"{source}: is no folder; give the one that holds the sequences")
    for folder in folders:
        if not (folder / _TRUTH).is_file():
            raise DatasetError(f"{folder}: has no {_TRUTH}; get it, or take it off {listed}")
    if not folders:
        raise DatasetError(
            f"{source}: holds no sequence of VOT, which is a folder with a {_TRUTH} and images"
        )
    return folders


def length_of(folder: Path) -> int:
    """Frames of a sequence, by its ground truth."""
    return len(read_text(folder / _TRUTH).split())
