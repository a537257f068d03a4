"""Reading image files of a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ssiam.errors import SourceError, one_line
from ssiam.geometry import Image, short_repr
from ssiam.video.images import UnreadableImage, read_pages
from ssiam.video.levels import Levels, find_levels, to_8bit


def read_image(path: Path, levels: Levels | None = None) -> Image:
    """An image file as (H, W, 3) uint8 BGR.

    Images of more than 8 bits are scaled by `levels`, by default those of the image itself.

    Raises
    ------
    SourceError
        The file is missing or is not an image.
    """
    image = read_deep(path)
    return to_8bit(image, levels or find_levels([image]))


def image_levels(path: Path) -> Levels | None:
    """The `Levels` of a sequence that begins with this image; None if it has 8 bits."""
    return find_levels([read_deep(path)])


def read_deep(path: Path) -> NDArray[Any]:
    """The first image in a file, (H, W) or (H, W, 3) BGR, in the file's bit depth.

    Raises
    ------
    SourceError
        The file is missing or is not an image.
    """
    try:
        exists = path.exists()
    except (OSError, ValueError) as error:  # a name that is too long, or has a zero byte
        raise SourceError(f"{short_repr(str(path))}: cannot be read ({one_line(error)})") from None
    if not exists:
        raise SourceError(f"{path}: does not exist; get the frames of the dataset")
    try:
        _, image = next(read_pages(path))
    except UnreadableImage:
        raise SourceError(f"{path}: is not an image that can be read; get it again") from None
    return image
