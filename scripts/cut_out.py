"""Objects cut out of pictures by their masks: stamps for `ssiam train` (4_more_objects.toml).

    python scripts/cut_out.py data/stills/horses data/stills/cats --out data/cut_out

A photograph of one object is of little use as it is: the search crop shows four times the target,
and so mostly what lies beyond the picture, whose edge gives the target away. Pasted on other
pictures (layout "stamps") the object has to be found by what it is. Every folder holds images and
masks of the same names, as of the layout "masks". Left out are small objects and those that the
picture's edges cut.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.training.data.image_readers import read_mask_images
from ssiam.training.data.masks import box_of_mask
from ssiam.training.data.tracks import NameFilter, TrainingTrack

LEAST = 48  # px, the shorter side of an object's box
LARGEST = 320  # px, the longer side of a stamp
CUT = 0.15  # of the box's outline, at most, along the picture's edges
SOFT = 1.0  # px, the blur of the alpha


def is_cut(mask: NDArray[np.bool_], side: float) -> bool:
    """Whether the picture's edges cut the object: along more than a share of its box."""
    edges = mask[0].sum() + mask[-1].sum() + mask[:, 0].sum() + mask[:, -1].sum()
    return bool(edges > CUT * 4 * side)


def stamp(track: TrainingTrack) -> NDArray[np.uint8] | None:
    """The object (h, w, 4) BGRA; None if it will not do."""
    mask = track.mask(0)
    box = None if mask is None else box_of_mask(mask)
    if mask is None or box is None or min(box[2:]) < LEAST or is_cut(mask, sum(box[2:]) / 2):
        return None
    x, y, w, h = map(int, box)
    # A pixel less all around: what lies behind shines through at an object's edge.
    alpha = cv2.erode(mask.astype(np.uint8) * 255, np.ones((3, 3), np.uint8))
    cut = np.dstack([track.image(0), cv2.GaussianBlur(alpha, (0, 0), SOFT)])[y : y + h, x : x + w]
    zoom = min(1.0, LARGEST / max(w, h))
    small = cv2.resize(cut, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def main() -> None:
    """Write the stamps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for folder in arguments.folders:
        stamps = [stamp(track) for track in read_mask_images(folder, NameFilter())]
        good = [each for each in stamps if each is not None]
        for number, each in enumerate(good):
            cv2.imwrite(str(arguments.out / f"{folder.name}_{number:04}.png"), each)
        print(f"{folder.name}: {len(good)} of {len(stamps)}")


if __name__ == "__main__":
    main()
