"""Tracks of the datasets of tracking: GOT-10k, LaSOT, and all that `ssiam.datasets` reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ssiam.datasets import Dataset, DatasetError, VideoSequence
from ssiam.geometry import XYWH
from ssiam.training.clips import Clip
from ssiam.training.sources import Names

# Tags of frames in which there is nothing to learn of the target.
_HIDDEN = ("full_occlusion", "out_of_view", "absence")
# Sequences kept in memory: reading one again takes as long as a few pictures.
_KEPT = 64


class SequenceSource:
    """A `Source` of the sequences of a dataset, each read when it is asked for, a few kept.

    Parameters
    ----------
    name : str
    dataset : Dataset
    names : Names
        Which of its sequences.
    weight : float
    alike : bool
    """

    def __init__(
        self, name: str, dataset: Dataset, names: Names, weight: float = 1.0, alike: bool = False
    ) -> None:
        self.name = name
        self.weight = weight
        self.alike = alike
        self._dataset = dataset
        self._names = [name for name in dataset.sequences if name in names]
        self._kept: dict[str, Clip] = {}

    def __len__(self) -> int:
        return len(self._names)

    def track(self, i: int) -> Clip:
        """The track of a sequence; `DatasetError` if its files are damaged."""
        name = self._names[i]
        if name not in self._kept:
            if len(self._kept) >= _KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[name] = clip_of(self._dataset.sequences[name])
        return self._kept[name]

    def beside(self, i: int) -> Sequence[int]:
        """None: a sequence tells one object."""
        return ()


def clip_of(sequence: VideoSequence) -> Clip:
    """The track of a sequence; where there is no box, or a tag tells so, its target is hidden.

    Raises
    ------
    DatasetError
        The sequence is a video file, whose frames cannot be had in any order.
    """
    if not isinstance(sequence.frames, tuple):
        raise DatasetError(f"{sequence.frames}: is a video; write its frames as images to train")
    boxes = tuple(_box(sequence, t) for t in range(len(sequence.frames)))
    return Clip(sequence.frames[0].parent.resolve(), sequence.frames, boxes)


def _box(sequence: VideoSequence, t: int) -> XYWH | None:
    if t >= len(sequence.truth) or not np.isfinite(sequence.truth[t]).all():
        return None
    hidden = any(sequence.tags[tag][t] for tag in _HIDDEN if tag in sequence.tags)
    return None if hidden else sequence.box(t)
