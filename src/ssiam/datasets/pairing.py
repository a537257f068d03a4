"""Frames and boxes of one sequence, which must be of one number."""

from __future__ import annotations

from pathlib import Path

from ssiam.datasets.errors import DatasetError


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
