"""MOTChallenge: NAME/img1/000001.jpg and NAME/gt/gt.txt, several objects in the same frames.

`ssiam.datasets.mot` has the format and tells which objects are read.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import DatasetError
from ssiam.datasets.mot import MotClip, clip_folders, read_clip
from ssiam.geometry import XYWH
from ssiam.training.clips import Clip
from ssiam.training.skipping import Skipped
from ssiam.training.sources import Names, TrainingTrack

# Share of an object that is visible in a frame to learn from.
_VISIBLE: Final = 0.4


def read_mot(folder: Path, names: Names) -> list[TrainingTrack]:
    """A track for every object of every clip, each with all frames of its clip.

    Parameters
    ----------
    folder : Path
        A clip, or clips in it or in the folders in it.
    names : Names
        Of the clips.

    Raises
    ------
    DatasetError
        There is no clip, or more than a tenth of them are damaged; the others are left out with a
        warning.
    """
    skipped = Skipped(folder)
    tracks: list[TrainingTrack] = []
    for path in clip_folders(folder):
        if path.resolve().name in names:
            with skipped.one():
                tracks += _tracks(read_clip(path, least_visible=_VISIBLE))
    skipped.tell()
    return tracks


def _tracks(clip: MotClip) -> list[Clip]:
    paths = clip.paths(0)
    last = max((each.span[1] for each in clip.objects), default=-1)
    if last >= len(paths):
        raise DatasetError(
            f"{clip.folder}: {len(paths)} images, but boxes up to frame {last + 1}; get it again"
        )
    where = clip.images.resolve()
    return [Clip(where, paths, _boxes(each.boxes(0, len(paths)))) for each in clip.objects]


def _boxes(xywh: NDArray[np.float64]) -> tuple[XYWH | None, ...]:
    rows: list[list[float]] = xywh.tolist()
    return tuple(None if math.isnan(x) else (x, y, w, h) for x, y, w, h in rows)
