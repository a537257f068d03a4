"""GOT-10k: train/, val/ and test/, each with list.txt and folders of 00000001.jpg and labels.

The authors call the boxes 1-based, but many begin at 0, and their toolkit and all trackers use
them unchanged, as this reader does. Test sequences have only their first box.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import check_counts, images_in
from ssiam.datasets.ground_truth import read_flags, read_labels, read_xywh, to_zero_based
from ssiam.datasets.sequence import VideoSequence

EXPECTS = "groundtruth.txt, meta_info.ini and 00000001.jpg in each GOT-10k_... folder"
SPLITS = ("train", "val", "test")

_ORIGIN = 0
_TRUTH = "groundtruth.txt"
_FILES = ("meta_info.ini", "absence.label", "cover.label")
_NAME = "GOT-10k_"
_FLAGS = ("absence", "cut_by_image")
_FULLY_VISIBLE = 8  # in cover.label, where 0 is hidden


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequence in `folder`, if it has this layout and is in the requested split."""
    if not (folder / _TRUTH).is_file() or options.split not in (None, folder.resolve().parent.name):
        return {}
    if not folder.name.startswith(_NAME) and not any((folder / name).is_file() for name in _FILES):
        return {}
    return {folder.name: partial(read_got10k, folder, options.as_published)}


def read_got10k(folder: Path, as_published: bool = False) -> VideoSequence:
    """One sequence, with nan for boxes without area unless `as_published`.

    Raises
    ------
    DatasetError
        A file is missing or damaged.
    """
    frames, boxes = images_in(folder), read_xywh(folder / _TRUTH)
    check_counts(folder, len(frames), len(boxes), one_is_enough=True)
    return VideoSequence(
        folder.name,
        frames,
        boxes if as_published else to_zero_based(boxes, _ORIGIN),
        tags=_tags(folder, len(frames)),
    )


def _tags(folder: Path, count: int) -> dict[str, NDArray[np.bool_]]:
    paths = {name: folder / f"{name}.label" for name in _FLAGS}
    tags = {name: read_flags(path, count) for name, path in paths.items() if path.is_file()}
    cover = folder / "cover.label"
    if cover.is_file():
        tags["occlusion"] = read_labels(cover, count) < _FULLY_VISIBLE
    return tags
