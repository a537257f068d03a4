"""Cut objects out of images by their masks: copy-paste objects for `ssiam train`.

    python scripts/cut_out.py data/stills/horses data/stills/cats --out data/cut_out

A photograph of a single large object is a poor training image: the search crop is four times as
wide as the target, so most of it is padding, and the edge of the padding reveals the target's
position. Pasted on other images (layout "stamps"), the object must be found by its appearance. Each
folder has images and masks of the same names, as in the layout "masks". Objects that are small or
cut off by the image border are skipped.
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

MIN_SIDE = 48  # px, shorter side of an object's box
MAX_SIDE = 320  # px, longer side of the written image
MAX_BORDER_SHARE = 0.15  # of the box's perimeter that may be on the image border
ALPHA_BLUR = 1.0  # px, standard deviation


def is_cut_off(mask: NDArray[np.bool_], side: float) -> bool:
    """Whether the image border cuts off an object whose box has this mean side, px."""
    border_pixels = mask[0].sum() + mask[-1].sum() + mask[:, 0].sum() + mask[:, -1].sum()
    return bool(border_pixels > MAX_BORDER_SHARE * 4 * side)


def cut_out(track: TrainingTrack) -> NDArray[np.uint8] | None:
    """The object (h, w, 4) BGRA; None if it has no mask, is small or is cut off."""
    mask = track.mask(0)
    box = None if mask is None else box_of_mask(mask)
    if mask is None or box is None or min(box[2:]) < MIN_SIDE or is_cut_off(mask, sum(box[2:]) / 2):
        return None
    x, y, w, h = map(int, box)
    # Pixels at the object's edge are mixed with the background: remove one pixel.
    alpha = cv2.erode(mask.astype(np.uint8) * 255, np.ones((3, 3), np.uint8))
    bgra = np.dstack([track.image(0), cv2.GaussianBlur(alpha, (0, 0), ALPHA_BLUR)])
    zoom = min(1.0, MAX_SIDE / max(w, h))
    object_bgra = bgra[y : y + h, x : x + w]
    small = cv2.resize(object_bgra, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def main() -> None:
    """Write an image per object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for folder in arguments.folders:
        objects = [cut_out(track) for track in read_mask_images(folder, NameFilter())]
        usable = [image for image in objects if image is not None]
        for number, image in enumerate(usable):
            cv2.imwrite(str(arguments.out / f"{folder.name}_{number:04}.png"), image)
        print(f"{folder.name}: {len(usable)} of {len(objects)}")


if __name__ == "__main__":
    main()
