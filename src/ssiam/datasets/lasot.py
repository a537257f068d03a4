"""LaSOT: CLASS/CLASS-1/img/00000001.jpg, groundtruth.txt, full_occlusion.txt, out_of_view.txt.

Boxes in the files are 1-based, as their author confirms. Boxes of an invisible target have no
area.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import check_counts, images_in
from ssiam.datasets.ground_truth import read_flags, read_xywh, to_zero_based
from ssiam.datasets.sequence import VideoSequence
from ssiam.parsing import is_number_word

EXPECTS = "groundtruth.txt, full_occlusion.txt and img/ in each CLASS/CLASS-1"
SPLITS = ("train", "test")

_ORIGIN = 1
_TRUTH = "groundtruth.txt"
_FLAGS = ("full_occlusion", "out_of_view")


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequence in `folder`, if it has this layout and is in the requested split."""
    is_sequence = (
        (folder / _TRUTH).is_file()
        and (folder / "img").is_dir()
        and any((folder / f"{name}.txt").is_file() for name in _FLAGS)
    )
    if not is_sequence or options.split not in (None, _split(folder.name)):
        return {}
    return {folder.name: partial(read_lasot, folder, options.as_published)}


def read_lasot(folder: Path, as_published: bool = False) -> VideoSequence:
    """One sequence, 0-based unless `as_published`.

    Raises
    ------
    DatasetError
        A file is missing or damaged.
    """
    frames, boxes = images_in(folder / "img"), read_xywh(folder / _TRUTH)
    check_counts(folder, len(frames), len(boxes))
    paths = {name: folder / f"{name}.txt" for name in _FLAGS}
    return VideoSequence(
        folder.name,
        frames,
        boxes if as_published else to_zero_based(boxes, _ORIGIN),
        tags={name: read_flags(path, len(boxes)) for name, path in paths.items() if path.is_file()},
    )


def _split(name: str) -> str:
    kind, _, number = name.rpartition("-")
    is_test = is_number_word(number) and int(number) in TEST_SPLIT.get(kind, ())
    return "test" if is_test else "train"


# The 280 test sequences by class and number ("airplane-1", ...); the other 1120 are for training.
TEST_SPLIT: dict[str, tuple[int, ...]] = {
    "airplane": (1, 9, 13, 15),
    "basketball": (1, 6, 7, 11),
    "bear": (2, 4, 6, 17),
    "bicycle": (2, 7, 9, 18),
    "bird": (2, 3, 15, 17),
    "boat": (3, 4, 12, 17),
    "book": (3, 10, 11, 19),
    "bottle": (1, 12, 14, 18),
    "bus": (2, 5, 17, 19),
    "car": (2, 6, 9, 17),
    "cat": (1, 3, 18, 20),
    "cattle": (2, 7, 12, 13),
    "chameleon": (3, 6, 11, 20),
    "coin": (3, 6, 7, 18),
    "crab": (3, 6, 12, 18),
    "crocodile": (3, 4, 10, 14),
    "cup": (1, 4, 7, 17),
    "deer": (4, 8, 10, 14),
    "dog": (1, 7, 15, 19),
    "drone": (2, 7, 13, 15),
    "electricfan": (1, 10, 18, 20),
    "elephant": (1, 12, 16, 18),
    "flag": (2, 3, 5, 9),
    "fox": (2, 3, 5, 20),
    "frog": (3, 4, 9, 20),
    "gametarget": (1, 2, 7, 13),
    "gecko": (1, 5, 16, 19),
    "giraffe": (2, 10, 13, 15),
    "goldfish": (3, 7, 8, 10),
    "gorilla": (4, 6, 9, 13),
    "guitar": (3, 8, 10, 16),
    "hand": (2, 3, 9, 16),
    "hat": (1, 2, 5, 18),
    "helmet": (5, 11, 13, 19),
    "hippo": (1, 7, 9, 20),
    "horse": (1, 4, 12, 15),
    "kangaroo": (2, 5, 11, 14),
    "kite": (4, 6, 10, 15),
    "leopard": (1, 7, 16, 20),
    "licenseplate": (6, 12, 13, 15),
    "lion": (1, 5, 12, 20),
    "lizard": (1, 3, 6, 13),
    "microphone": (2, 6, 14, 16),
    "monkey": (3, 4, 9, 17),
    "motorcycle": (1, 3, 9, 18),
    "mouse": (1, 8, 9, 17),
    "person": (1, 5, 10, 12),
    "pig": (2, 10, 13, 18),
    "pool": (3, 7, 12, 15),
    "rabbit": (10, 13, 17, 19),
    "racing": (10, 15, 16, 20),
    "robot": (1, 5, 8, 19),
    "rubicCube": (1, 6, 14, 19),
    "sepia": (6, 8, 13, 16),
    "shark": (2, 3, 5, 6),
    "sheep": (3, 5, 7, 9),
    "skateboard": (3, 8, 16, 19),
    "spider": (14, 16, 18, 20),
    "squirrel": (8, 11, 13, 19),
    "surfboard": (4, 5, 8, 12),
    "swing": (10, 14, 17, 20),
    "tank": (6, 9, 14, 16),
    "tiger": (4, 6, 12, 18),
    "train": (1, 7, 11, 20),
    "truck": (3, 6, 7, 16),
    "turtle": (5, 8, 9, 16),
    "umbrella": (2, 9, 17, 19),
    "volleyball": (1, 13, 18, 19),
    "yoyo": (7, 15, 17, 19),
    "zebra": (10, 14, 16, 17),
}
