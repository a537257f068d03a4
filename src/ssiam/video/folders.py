"""Frames out of image files: a folder of them, or one that holds several frames."""

from __future__ import annotations

import re
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

from ssiam.errors import SourceError, StreamError
from ssiam.video.frames import DeepPictures, Source, SourceFacts
from ssiam.video.images import UnreadableImage, page_count, read_pages
from ssiam.video.levels import Levels, eight_bit

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp")

_FOLDER_FPS = Fraction(30)


def open_folder(folder: Path, fps: Fraction = _FOLDER_FPS, levels: Levels | None = None) -> Source:
    """`Source` of the images in `folder`, in natural order (2.jpg before 10.jpg).

    Other files are passed over. A file with several pages or frames gives all of them. Images
    carry no times: ``time = index / fps``.
    """
    paths = image_paths(folder)
    if not paths:
        raise SourceError(f"{folder}: {_what_is_missing(folder)}")
    length = sum(map(_frames_in, paths))
    facts = SourceFacts()
    deep = _pictures(str(folder), paths, fps, length)
    pictures = eight_bit(str(folder), deep, facts, levels)
    return Source(str(folder), pictures, fps=fps, length=length, facts=facts)


def open_stack(path: Path, levels: Levels | None = None) -> Source:
    """`Source` of the pages of a TIFF (``time = index / 30``) or the frames of an animated WebP."""
    name, length, told = str(path), _frames_in(path), _told_fps(path)
    fps = told or _FOLDER_FPS
    facts = SourceFacts(is_variable=told is not None)
    pictures = eight_bit(name, _pictures(name, [path], fps, length), facts, levels)
    return Source(name, pictures, fps=fps, length=length, facts=facts)


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


def _pictures(name: str, paths: list[Path], fps: Fraction, length: int) -> DeepPictures:
    """Every frame of every file, at its own time where a file tells how long it is shown."""
    delivered, time = 0, Fraction(0)
    for path in paths:
        try:
            for duration, image in read_pages(path):
                yield float(time), image
                delivered += 1
                time += duration or 1 / fps
        except UnreadableImage:
            if not delivered:
                raise SourceError(
                    f"{path}: cannot be read as an image; replace or remove it"
                ) from None
            raise StreamError(
                f"{name}: broke off after {delivered} of {length} frames: {path.name} "
                "cannot be read as an image; replace or remove it"
            ) from None


def _told_fps(path: Path) -> Fraction | None:
    """Frames a second by the first frame's own duration; None where none is told."""
    with suppress(UnreadableImage):
        duration, _ = next(read_pages(path))
        return 1 / duration if duration else None
    return None


def _frames_in(path: Path) -> int:
    try:
        return page_count(path)
    except OSError:
        return 1


def _what_is_missing(folder: Path) -> str:
    kinds = " ".join(suffix[1:] for suffix in IMAGE_SUFFIXES)
    inside = next((d for d in sorted(folder.iterdir()) if d.is_dir() and image_paths(d)), None)
    if inside is not None:
        return f"holds no images itself; did you mean {inside}?"
    return f"holds no images ({kinds}); give the folder that holds the frames"
