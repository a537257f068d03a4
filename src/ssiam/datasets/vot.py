"""VOT2013 to VOT2019, in the layouts of the challenge's toolkits.

Both layouts are read: the classic one (groundtruth.txt beside 00000001.jpg) and the newer one (a
file `sequence` of key=value lines, the images in color/). Boxes are not changed: 0-based.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import check_counts, image_folder, images_in, inside, read_text
from ssiam.datasets.ground_truth import read_boxes, read_flags
from ssiam.datasets.sequence import VideoSequence
from ssiam.parsing import is_number_word

EXPECTS = "groundtruth.txt in each sequence's folder, with the images in it or in its color/"

_TRUTH = "groundtruth.txt"
_SETTINGS = "sequence"
_TAG_SUFFIXES = (".tag", ".label")


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequence in `folder`, if it has this layout."""
    is_sequence = (folder / _TRUTH).is_file() or (folder / _SETTINGS).is_file()
    return {folder.name: partial(read_vot, folder)} if is_sequence else {}


def read_vot(folder: Path) -> VideoSequence:
    """One sequence; boxes are not changed.

    Raises
    ------
    DatasetError
        A file is missing or damaged.
    """
    settings = _settings(folder / _SETTINGS)
    frames = images_in(_frames_folder(folder, settings))
    truth = read_boxes(inside(folder, settings.get("groundtruth", _TRUTH), folder / _SETTINGS))
    check_counts(folder, len(frames), len(truth))
    tag_files = sorted(path for path in folder.iterdir() if path.suffix in _TAG_SUFFIXES)
    return VideoSequence(
        folder.name,
        frames,
        truth,
        tags={path.stem: read_flags(path, len(truth), may_be_short=True) for path in tag_files},
        size_wh=_size_wh(settings),
    )


def _settings(path: Path) -> dict[str, str]:
    if not path.is_file():
        return {}
    pairs = (line.partition("=") for line in read_text(path).splitlines())
    return {key.strip(): value.strip() for key, equals, value in pairs if equals}


def _frames_folder(folder: Path, settings: dict[str, str]) -> Path:
    """The folder of the default channel, from its file pattern (color/%08d.jpg)."""
    channel = settings.get("channel.default", "color")
    pattern = settings.get(f"channels.{channel}")
    if pattern is None:
        return image_folder(folder)
    path = inside(folder, pattern, folder / _SETTINGS)
    return path.parent if "%" in path.name else path


def _size_wh(settings: dict[str, str]) -> tuple[int, int] | None:
    values = [settings.get(key, "") for key in ("width", "height")]
    if not all(is_number_word(value) and len(value) < 7 for value in values):
        return None
    return int(values[0]), int(values[1])
