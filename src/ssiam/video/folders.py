"""Frames out of a folder of images."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from ssiam.errors import SourceError, StreamError
from ssiam.geometry import Image
from ssiam.video.frames import Pictures, Source

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp")

_FOLDER_FPS = Fraction(30)


def open_folder(folder: Path, fps: Fraction = _FOLDER_FPS) -> Source:
    """`Source` of the images in `folder`, in natural order (2.jpg before 10.jpg).

    Other files are passed over. Images carry no times: ``time = index / fps``.
    """
    paths = image_paths(folder)
    if not paths:
        raise SourceError(f"{folder}: {_what_is_missing(folder)}")
    return Source(str(folder), _pictures(folder, paths, fps), fps=fps, length=len(paths))


def image_paths(folder: Path) -> list[Path]:
    """Images of a folder in natural order; hidden files and sub-folders are left out."""
    found = (
        path
        for path in folder.iterdir()
        if path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".")
    )
    return sorted((path for path in found if path.is_file()), key=_natural_key)


def _natural_key(path: Path) -> tuple[list[tuple[int, str]], str]:
    parts = re.findall(r"[0-9]+|[^0-9]+", path.name.lower())
    numbered = [(int(part), "") if part.isdigit() else (-1, part) for part in parts]
    return numbered, path.name


def _pictures(folder: Path, paths: list[Path], fps: Fraction) -> Pictures:
    for index, path in enumerate(paths):
        image = _read(path)
        if image is None and index == 0:
            raise SourceError(f"{path}: cannot be read as an image; replace or remove it")
        if image is None:
            raise StreamError(
                f"{folder}: broke off after {index} of {len(paths)} frames: {path.name} "
                "cannot be read as an image; replace or remove it"
            )
        yield float(index / fps), image


def _read(path: Path) -> Image | None:
    """BGR image, or None. Not `cv2.imread`, which fails on non-Latin paths under Windows."""
    try:
        encoded = np.fromfile(path, dtype=np.uint8)
        decoded = cv2.imdecode(encoded, cv2.IMREAD_COLOR) if encoded.size else None
    except (OSError, cv2.error):
        return None
    return None if decoded is None else np.asarray(decoded, dtype=np.uint8)


def _what_is_missing(folder: Path) -> str:
    kinds = " ".join(suffix[1:] for suffix in IMAGE_SUFFIXES)
    inside = next((d for d in sorted(folder.iterdir()) if d.is_dir() and image_paths(d)), None)
    if inside is not None:
        return f"holds no images itself; did you mean {inside}?"
    return f"holds no images ({kinds}); give the folder that holds the frames"
