"""Image files and folders of them: every page and frame, at its full depth."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import SourceError, SsiamError, StreamError
from ssiam.parsing import is_number_word
from ssiam.video.frames import DecodedImages, Source, SourceInfo
from ssiam.video.image_sizes import check_file, check_pixels, declared_sizes, max_pixels
from ssiam.video.levels import Levels, convert_to_8bit

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp")

# Frames per second of images that carry no times.
_DEFAULT_FPS = Fraction(30)
# BGR at the full bit depth, rotated according to EXIF.
_UNCHANGED = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
# OpenCV does not convert floating-point TIFF to color.
_TIFF_UNCHANGED = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH
_TIFF_MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_ANIMATION_FLAG = 0x02  # of the byte after "VP8X" and its size, in WebP
# The most pages decoded at a time: OpenCV walks over those before them each time.
_CHUNK = 16
# Milliseconds of a frame without a duration, as in browsers.
_DEFAULT_DURATION_MS = 100


class UnreadableImage(Exception):
    """An image file that cannot be read, or only in part."""


def open_folder(folder: Path, fps: Fraction = _DEFAULT_FPS, levels: Levels | None = None) -> Source:
    """`Source` of the images in `folder`, in natural order (2.jpg before 10.jpg).

    Other files are ignored. A file with several pages or frames yields all of them. Images
    without a duration get ``time = index / fps``.
    """
    paths = image_paths(folder)
    if not paths:
        raise SourceError(f"{folder}: {_empty_folder_advice(folder)}")
    length = sum(map(_frames_in, paths))
    info = SourceInfo()
    decoded = _images(str(folder), paths, fps, length)
    images = convert_to_8bit(str(folder), decoded, info, levels)
    return Source(str(folder), images, fps=fps, length=length, info=info)


def open_stack(path: Path, levels: Levels | None = None) -> Source:
    """`Source` of the pages of a TIFF (``time = index / 30``) or the frames of an animated WebP."""
    name, length, file_fps = str(path), _frames_in(path), _file_fps(path)
    fps = file_fps or _DEFAULT_FPS
    info = SourceInfo(is_variable=file_fps is not None)
    images = convert_to_8bit(name, _images(name, [path], fps, length), info, levels)
    return Source(name, images, fps=fps, length=length, info=info)


def image_paths(folder: Path) -> list[Path]:
    """Images of a folder in natural order, without hidden files and sub-folders."""
    found = (
        path
        for path in folder.iterdir()
        if path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".")
    )
    return sorted((path for path in found if path.is_file()), key=_natural_key)


def _natural_key(path: Path) -> tuple[list[tuple[int, str]], str]:
    parts = re.findall(r"[0-9]+|[^0-9]+", path.name.lower())
    numbered = [(int(part), "") if is_number_word(part) else (-1, part) for part in parts]
    return numbered, path.name


def _images(name: str, paths: list[Path], fps: Fraction, length: int) -> DecodedImages:
    """Every frame of every file, timed by its duration if the file has one, else by `fps`."""
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


def _file_fps(path: Path) -> Fraction | None:
    """Frames per second from the first frame's duration; None if it has none."""
    with suppress(UnreadableImage):
        duration, _ = next(read_pages(path))
        return 1 / duration if duration else None
    return None


def _frames_in(path: Path) -> int:
    try:
        return _page_count(path)
    except (OSError, struct.error, cv2.error):
        return 1


def _empty_folder_advice(folder: Path) -> str:
    kinds = " ".join(suffix[1:] for suffix in IMAGE_SUFFIXES)
    inside = next((d for d in sorted(folder.iterdir()) if d.is_dir() and image_paths(d)), None)
    if inside is not None:
        return f"holds no images itself; did you mean {inside}?"
    return f"holds no images ({kinds}); give the folder that holds the frames"


def is_stack(head: bytes) -> bool:
    """Whether a file with these first 32 bytes is a TIFF or an animated WebP."""
    return head[:4] in _TIFF_MAGIC or _is_animated_webp(head)


def _is_stack_file(path: Path) -> bool:
    if not path.is_file():  # opening a pipe would wait for its writer
        raise OSError(f"{path} is not a file")
    with path.open("rb") as file:
        return is_stack(file.read(32))


def read_pages(path: Path) -> Iterator[tuple[Fraction | None, NDArray[Any]]]:
    """Display duration (seconds, None if unknown) and pixels of each frame of an image file.

    Frames are (H, W) or (H, W, 3) BGR, of any bit depth. The file is loaded completely.

    Raises
    ------
    UnreadableImage
        At the first frame that cannot be read.
    SourceError
        The file declares more than `max_pixels` pixels.
    """
    try:
        check_file(path, is_stack=_is_stack_file(path))
        count = _page_count(path)
        # Not `cv2.imread`, which fails on non-Latin paths under Windows, and not a memory map: if
        # another program truncates a mapped file, the system ends this process (SIGBUS).
        data = np.fromfile(path, dtype=np.uint8)
        head = data[:32].tobytes()
        chunk = _checked_chunk(path, data)
        if head[:4] in _TIFF_MAGIC:
            yield from ((None, page) for page in _tiff(data, count, chunk))
        elif _is_animated_webp(head):
            yield from _animation(data, count, chunk)
        else:
            yield None, _decoded(data)
    except SsiamError:
        raise
    except (OSError, ValueError, MemoryError, SystemError, struct.error, cv2.error) as error:
        raise UnreadableImage(path) from error


def _checked_chunk(path: Path, data: NDArray[np.uint8]) -> int:
    """Pages to decode at a time; `SourceError` if one of them declares too many pixels."""
    sizes = declared_sizes(memoryview(data))  # type: ignore[arg-type]
    if not sizes:
        raise UnreadableImage(path)
    width, height = max(sizes, key=math.prod)
    check_pixels(str(path), width, height)
    return max(1, min(_CHUNK, max_pixels() // max(width * height, 1)))


def _page_count(path: Path) -> int:
    """Number of frames in an image file, according to its header; at least 1."""
    with path.open("rb") as file:
        head = file.read(32)
        if head[:4] in _TIFF_MAGIC:
            return max(1, _tiff_pages(file, head))
    return max(1, cv2.imcount(str(path))) if _is_animated_webp(head) else 1


def _decoded(data: NDArray[np.uint8]) -> NDArray[Any]:
    image: NDArray[Any] | None = cv2.imdecode(data, _UNCHANGED)
    if image is None:
        raise UnreadableImage
    return image


def _tiff(data: NDArray[np.uint8], count: int, chunk: int) -> Iterator[NDArray[Any]]:
    """Pages, except those smaller than the first, which are its previews."""
    first: tuple[int, ...] | None = None
    for start in range(0, count, chunk):
        stop = min(start + chunk, count)
        _, pages = cv2.imdecodemulti(data, _TIFF_UNCHANGED, range=(start, stop))
        for page in pages:
            first = first or page.shape
            if page.shape[0] >= first[0] or page.shape[1] >= first[1]:
                yield np.ascontiguousarray(page[..., :3]) if page.ndim == 3 else page
        if len(pages) < stop - start:
            raise UnreadableImage


def _animation(
    data: NDArray[np.uint8], count: int, chunk: int
) -> Iterator[tuple[Fraction, NDArray[Any]]]:
    for start in range(0, count, chunk):
        wanted = min(chunk, count - start)
        _, animation = cv2.imdecodeanimation(data, start, wanted)
        for frame, milliseconds in zip(animation.frames, animation.durations, strict=False):
            yield (
                Fraction(int(milliseconds) or _DEFAULT_DURATION_MS, 1000),
                np.ascontiguousarray(frame[..., :3]),
            )
        if len(animation.frames) < wanted:
            raise UnreadableImage


def _is_animated_webp(head: bytes) -> bool:
    is_extended = head[:4] == b"RIFF" and head[8:16] == b"WEBPVP8X"
    return is_extended and len(head) > 20 and bool(head[20] & _ANIMATION_FLAG)


def _tiff_pages(file: BinaryIO, head: bytes) -> int:
    """Number of directories in a TIFF (or BigTIFF), including an announced one that is missing."""
    order = "<" if head[:2] == b"II" else ">"
    is_big = head[2:4] in (b"+\0", b"\0+")
    count_format, entry_size, offset_format = ("Q", 20, "Q") if is_big else ("H", 12, "I")
    (offset,) = struct.unpack_from(order + offset_format, head, 8 if is_big else 4)
    visited: set[int] = set()
    while offset and offset not in visited:
        visited.add(offset)
        file.seek(offset)
        entry_count = file.read(struct.calcsize(order + count_format))
        if len(entry_count) < struct.calcsize(order + count_format):
            break
        file.seek(struct.unpack(order + count_format, entry_count)[0] * entry_size, 1)
        next_offset = file.read(struct.calcsize(order + offset_format))
        if len(next_offset) < struct.calcsize(order + offset_format):
            break
        (offset,) = struct.unpack(order + offset_format, next_offset)
    return len(visited)
