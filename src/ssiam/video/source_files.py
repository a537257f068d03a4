"""`check_distinct_from_source`: outputs must not be files that a source is read from."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from ssiam.addresses import is_address
from ssiam.errors import ArgumentError
from ssiam.outputs import NamedPath, check_distinct
from ssiam.video.images import IMAGE_SUFFIXES, image_paths
from ssiam.video.sources import STDIN, camera_index, path_of_file_address

_M3U, _FFCONCAT = b"#EXTM3U", b"ffconcat"  # first bytes of playlists
_LONGEST_LIST = 1 << 20  # bytes read of a playlist
_STANDARD_INPUT = Path("/dev/stdin")  # also when it is redirected from a file


def check_distinct_from_source(
    outputs: Sequence[NamedPath], source: str, inputs: Iterable[NamedPath] = ()
) -> None:
    """`check_distinct` for the files that `open_source` would read, and for other inputs.

    A folder counts as its images, a local playlist (.m3u8, .ffconcat) as the files that it lists.
    A new image in a source folder is refused too: the next run would read it as a frame. No video
    is opened.

    Raises
    ------
    ArgumentError
        An output is an input, or would be read as one. The message names both.
    """
    path = _path(source)
    if path is None:
        check_distinct(outputs, inputs)
        return
    images = _images(path) if path.is_dir() else []
    files = (path, *images, *_listed(path))
    check_distinct(outputs, [*(("the source", each) for each in files), *inputs])
    for option, output in outputs:
        if images and _would_be_read(output, path):
            raise ArgumentError(
                f"{option} {output} is in the source folder {path}, where it would be read as a "
                "frame; give another folder"
            )


def _path(source: str) -> Path | None:
    """The file or folder of a source, if it has one."""
    if source == STDIN:
        return _STANDARD_INPUT
    if is_address(source):
        is_file = source.lower().startswith("file://")
        return Path(path_of_file_address(source).replace("\0", "")) if is_file else None
    return None if camera_index(source) is not None or not source else Path(source)


def _images(folder: Path) -> list[Path]:
    try:
        return image_paths(folder)
    except OSError:  # reported when it is opened
        return []


def _listed(path: Path) -> list[Path]:
    """The files that a playlist lists, including those of nested playlists."""
    found: list[Path] = []
    visited = {_identity(str(path))}
    waiting = [path]
    while waiting:
        playlist = waiting.pop()
        folder = str(playlist.parent)
        for name in dict.fromkeys(_names_in(playlist)):
            identity = _identity(os.path.join(folder, name))
            if identity not in visited:
                visited.add(identity)
                found.append(playlist.parent / name)
                if not isinstance(identity, str):
                    waiting.append(found[-1])
    return found


def _identity(path: str) -> tuple[int, int] | str:
    """Device and number of a file, the same under all its names; the path of a missing one."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return path
    return status.st_dev, status.st_ino


def _names_in(path: Path) -> list[str]:
    try:
        if not path.is_file():
            return []
        with path.open("rb") as file:
            head = file.read(len(_FFCONCAT))
            is_list = head.startswith(_M3U) or head == _FFCONCAT
            text = file.read(_LONGEST_LIST).decode("utf-8", "replace") if is_list else ""
            text = text.replace("\0", "")  # no file has such a name
    except OSError:  # reported when it is opened
        return []
    lines = [stripped for line in text.splitlines() if (stripped := line.strip())]
    if head == _FFCONCAT:
        entries = [line.split(None, 1) for line in lines]
        return [each[1].strip(" '\"") for each in entries if len(each) == 2 and each[0] == "file"]
    names = [line for line in lines if not line.startswith("#")]
    attributes = [each.partition('"') for each in text.split('URI="')[1:]]
    return names + [name for name, quote, _ in attributes if name and quote]


def _would_be_read(output: Path, folder: Path) -> bool:
    """Whether the output would be an image of the folder."""
    target = Path(os.path.realpath(output))
    try:
        return target.suffix.lower() in IMAGE_SUFFIXES and target.parent.samefile(folder)
    except OSError:  # reported when it is opened
        return False
