"""`check_apart_from_source`: outputs beside the files that a source is read from."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from urllib.parse import unquote, urlsplit

from ssiam.errors import ArgumentError
from ssiam.outputs import NamedPath, check_apart
from ssiam.video.addresses import is_address
from ssiam.video.folders import IMAGE_SUFFIXES, image_paths
from ssiam.video.sources import STDIN, camera_number

_STANDARD_INPUT = Path("/dev/stdin")  # also when it is redirected from a file


def check_apart_from_source(
    outputs: Sequence[NamedPath], source: str, inputs: Iterable[NamedPath] = ()
) -> None:
    """`check_apart` of what `open_source` would read, and of other inputs; opens nothing.

    Images beside those of a source that is a folder are refused too: the next run would take them
    for frames.

    Raises
    ------
    ArgumentError
        One line that names the output and the input.
    """
    path = _path(source)
    if path is None:
        check_apart(outputs, inputs)
        return
    images = _images(path) if path.is_dir() else []
    check_apart(outputs, [*(("the source", each) for each in (path, *images)), *inputs])
    for option, output in outputs:
        if images and _would_be_read(output, path):
            raise ArgumentError(
                f"{option} {output} lies in the source {path}, where it would be read as a frame; "
                "give another folder"
            )


def _path(source: str) -> Path | None:
    """The file or folder that a source is, if it is one."""
    if source == STDIN:
        return _STANDARD_INPUT
    if is_address(source):
        is_file = source.lower().startswith("file://")
        return Path(unquote(urlsplit(source).path)) if is_file else None
    return None if camera_number(source) is not None or not source else Path(source)


def _images(folder: Path) -> list[Path]:
    try:
        return image_paths(folder)
    except OSError:  # told when it is opened
        return []


def _would_be_read(output: Path, folder: Path) -> bool:
    """Whether the output will be an image of the folder."""
    target = Path(os.path.realpath(output))
    try:
        return target.suffix.lower() in IMAGE_SUFFIXES and target.parent.samefile(folder)
    except OSError:  # told when it is opened
        return False
