"""LaSOT: CLASS/CLASS-1/img/00000001.jpg, groundtruth.txt, full_occlusion.txt, out_of_view.txt.

Boxes in the files are 1-based, as their author confirms; where the target is not to be seen they
have no area.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ssiam.datasets.boxes import located, read_xywh
from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import images_in
from ssiam.datasets.labels import read_flags
from ssiam.datasets.lasot_split import TEST
from ssiam.datasets.pairing import check_counts
from ssiam.datasets.sequence import Sequence

EXPECTS = "groundtruth.txt, full_occlusion.txt and img/ in each CLASS/CLASS-1"
SPLITS = ("train", "test")

_ORIGIN = 1
_TRUTH = "groundtruth.txt"
_FLAGS = ("full_occlusion", "out_of_view")


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequence that `folder` holds, if it is one of this layout and of the wanted split."""
    is_one = (
        (folder / _TRUTH).is_file()
        and (folder / "img").is_dir()
        and any((folder / f"{name}.txt").is_file() for name in _FLAGS)
    )
    if not is_one or options.split not in (None, _split(folder.name)):
        return {}
    return {folder.name: partial(read_lasot, folder, options.as_published)}


def read_lasot(folder: Path, as_published: bool = False) -> Sequence:
    """One sequence, 0-based unless `as_published`.

    Raises
    ------
    DatasetError
        Something is missing or damaged.
    """
    frames, boxes = images_in(folder / "img"), read_xywh(folder / _TRUTH)
    check_counts(folder, len(frames), len(boxes))
    paths = {name: folder / f"{name}.txt" for name in _FLAGS}
    return Sequence(
        folder.name,
        frames,
        boxes if as_published else located(boxes, _ORIGIN),
        tags={name: read_flags(path, len(boxes)) for name, path in paths.items() if path.is_file()},
    )


def _split(name: str) -> str:
    kind, _, number = name.rpartition("-")
    is_test = number.isascii() and number.isdigit() and int(number) in TEST.get(kind, ())
    return "test" if is_test else "train"
