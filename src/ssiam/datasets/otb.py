"""OTB50 and OTB100: NAME/img/0001.jpg and NAME/groundtruth_rect.txt.

Boxes in the files are 1-based. A folder may have two targets (groundtruth_rect.1.txt and .2.txt),
which are separate sequences, NAME-1 and NAME-2.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import check_counts, image_folder, images_in, numbered
from ssiam.datasets.ground_truth import read_xywh, to_zero_based
from ssiam.datasets.sequence import VideoSequence

# First and last image of the sequences whose boxes do not cover all images from 0001 on, from the
# benchmark's web page. Tiger1 has boxes from 0001 on, but the benchmark starts at 0006.
RANGES: dict[str, tuple[int, int]] = {
    "BlurCar1": (247, 988),
    "BlurCar3": (3, 359),
    "BlurCar4": (18, 397),
    "David": (300, 770),
    "Diving": (1, 215),
    "Football1": (1, 74),
    "Freeman3": (1, 460),
    "Freeman4": (1, 283),
    "Tiger1": (6, 354),
}

# The 50 harder ones of the 100 (TB-50); all others are in OTB100 only.
# fmt: off
OTB50: frozenset[str] = frozenset((
    "Basketball", "Biker", "Bird1", "BlurBody", "BlurCar2", "BlurFace", "BlurOwl", "Bolt", "Box",
    "Car1", "Car4", "CarDark", "CarScale", "ClifBar", "Couple", "Crowds", "David", "Deer", "Diving",
    "DragonBaby", "Dudek", "Football", "Freeman4", "Girl", "Human3", "Human4-2", "Human6", "Human9",
    "Ironman", "Jump", "Jumping", "Liquor", "Matrix", "MotorRolling", "Panda", "RedTeam", "Shaking",
    "Singer2", "Skating1", "Skating2-1", "Skating2-2", "Skiing", "Soccer", "Surfer", "Sylvester",
    "Tiger2", "Trellis", "Walking", "Walking2", "Woman",
))
# fmt: on

EXPECTS = "groundtruth_rect.txt and img/ in each sequence's folder"
SPLITS = ("otb50", "otb100")

_ORIGIN = 1
_EMPTY_FILE = 2  # bytes: the first file of Human4 has only a line break
_TRUTH = re.compile(r"groundtruth_rect(?:\.?(\d))?\.txt")
# Copies of a folder for one of its two targets: Jogging-1, Jogging.2.
_ONE_OF_TWO = re.compile(r"(.+)[-._](\d)")


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequences in `folder`, one for each of its ground truth files."""
    found = {}
    for path in sorted(folder.glob("groundtruth_rect*.txt")):
        name = _name(folder, path)
        if name is not None and (options.split != "otb50" or name in OTB50):
            found[name] = partial(read_otb, folder, path, options.as_published)
    return found


def read_otb(folder: Path, truth_path: Path, as_published: bool = False) -> VideoSequence:
    """The sequence of one ground truth file, 0-based unless `as_published`.

    If the benchmark uses only a part of the images (David from 0300 on), that part is selected by
    number. Otherwise there must be a box for every image.

    Raises
    ------
    DatasetError
        A file is missing or damaged, or the numbers of boxes and images differ.
    """
    boxes = read_xywh(truth_path)
    frames, boxes = _evaluated(folder, images_in(image_folder(folder)), boxes)
    check_counts(folder, len(frames), len(boxes))
    return VideoSequence(
        _name(folder, truth_path) or folder.name,
        frames,
        boxes if as_published else to_zero_based(boxes, _ORIGIN),
    )


def _name(folder: Path, truth_path: Path) -> str | None:
    """Name of the sequence; None if the file has no boxes or is for another copy of the folder."""
    match = _TRUTH.fullmatch(truth_path.name)
    if match is None or truth_path.stat().st_size <= _EMPTY_FILE:
        return None
    if match[1] is None:
        return folder.name
    copied = _ONE_OF_TWO.fullmatch(folder.name)
    if copied is None:
        return f"{folder.name}-{match[1]}"
    return f"{copied[1]}-{match[1]}" if copied[2] == match[1] else None


def _evaluated(
    folder: Path, images: tuple[Path, ...], boxes: NDArray[np.float64]
) -> tuple[tuple[Path, ...], NDArray[np.float64]]:
    """Images and boxes of the frames that the benchmark uses; all if an image is missing."""
    if folder.name not in RANGES:
        return images, boxes
    first, last = RANGES[folder.name]
    by_number = numbered(images)
    wanted = range(first, last + 1)
    if not by_number.keys() >= set(wanted):
        return images, boxes
    frames = tuple(by_number[number] for number in wanted)
    return frames, boxes[first - 1 :] if len(boxes) == last else boxes
