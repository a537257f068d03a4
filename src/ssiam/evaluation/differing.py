"""`Differing`: where a tracker alone and the same tracker steadied differ most."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.evaluation.raster import Floats
from ssiam.evaluation.regions import upright
from ssiam.evaluation.summaries import Summaries, Summary
from ssiam.evaluation.tracked import TrackedSequence
from ssiam.geometry import iou
from ssiam.stabilize import StabilizerConfig

# Frames that are shown, and the share of the sequence that lies between two of them at least.
_SHOWN: Final = 6
_APART: Final = 1 / 15


@dataclass(frozen=True, eq=False)
class Differing:
    """One tracker on one sequence, alone and steadied.

    Attributes
    ----------
    tracker : str
    sequence : VideoSequence
    one_pass : bool
        Whether the runs are one-pass ones; if not, the tracker was restarted after each loss.
    truth, off, steadied : (N, 4) float64
        Boxes x, y, w, h, pixels; nan where there is none.
    """

    tracker: str
    sequence: VideoSequence
    one_pass: bool
    truth: Floats
    off: Floats
    steadied: Floats

    @property
    def overlaps(self) -> Floats:
        """Overlap of both with the truth, (2, N): off, steadied; 0 where there is no box."""
        return np.nan_to_num([iou(boxes, self.truth) for boxes in (self.off, self.steadied)])

    @property
    def frames(self) -> list[int]:
        """Indices of the frames in which the overlaps differ most, in order, not side by side."""
        off, steadied = self.overlaps
        difference = np.abs(steadied - off)
        chosen: list[int] = []
        for index in np.argsort(-difference, kind="stable").tolist():
            apart = all(abs(index - other) >= _APART * len(difference) for other in chosen)
            if apart and difference[index] > 0 and len(chosen) < _SHOWN:
                chosen.append(index)
        return sorted(chosen)


def most_differing(found: Summaries) -> Differing | None:
    """The tracker and sequence on which steadying changes most, for better or worse.

    First by lost targets, then by mean overlap; by one-pass runs if a tracker has them on the
    sequence both alone and steadied. None if no tracker was run both ways.
    """
    steadied = StabilizerConfig("paper")
    pairs = [
        (other, each)
        for each in found.entries
        if each.config == steadied
        if (other := found.find(each.tracker, StabilizerConfig("off"))) is not None
    ]
    ranked = [
        (
            abs(on.lost[name] - off.lost[name]),
            _change(on.overlaps, off.overlaps, name),
            name,
            off,
            on,
        )
        for off, on in pairs
        for name in off.lost
        if name in on.lost
    ]
    if not ranked:
        return None
    *_, name, off, on = max(ranked, key=lambda each: each[:2])
    return _differing(name, off, on)


def _change(first: Mapping[str, float], second: Mapping[str, float], name: str) -> float:
    change = abs(first[name] - second[name])
    return 0.0 if math.isnan(change) else change


def _differing(name: str, off: Summary, steadied: Summary) -> Differing:
    one_pass = name in off.one_pass and name in steadied.one_pass
    first, second = (each.one_pass if one_pass else each.supervised for each in (off, steadied))
    sequence = first[name].sequence
    count = min(len(each.runs[0]) for each in (first[name], second[name]))
    return Differing(
        off.tracker,
        sequence,
        one_pass,
        upright(sequence.truth[:count]),
        _boxes(first[name], count),
        _boxes(second[name], count),
    )


def _boxes(tracked: TrackedSequence, count: int) -> Floats:
    return upright(tracked.runs[0].regions[:count])
