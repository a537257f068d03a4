"""DTB70: NAME/img/00001.jpg and NAME/groundtruth_rect.txt, or NAME.txt in a single sequence.

The authors do not state whether boxes are 0-based or 1-based. Toolkits do not change them, and
neither does this reader.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ssiam.datasets.clips import read_clip
from ssiam.datasets.dataset import Options, Readers
from ssiam.datasets.files import named_like

EXPECTS = "groundtruth_rect.txt and img/00001.jpg in each sequence's folder"

_TRUTH = "groundtruth_rect.txt"
_NOT_DTB70 = "Board"  # the only sequence of OTB whose image names have five digits


def sequences_in(folder: Path, options: Options) -> Readers:
    """The sequence in `folder`, if it has this layout."""
    if not (folder / "img").is_dir() or folder.name == _NOT_DTB70:
        return {}
    published = folder / _TRUTH if (folder / "img" / "00001.jpg").is_file() else None
    truth_path = published if published and published.is_file() else named_like(folder)
    if truth_path is None:
        return {}
    return {folder.name: partial(read_clip, folder, truth_path, options.as_published)}
