"""`doubtful_frames`: where a person should look next, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ssiam.exchange.blending import Blend, Section

_LOW_SCORE: Final = 0.5  # the probability that a box is right
_LOW_AGREEMENT: Final = 0.5  # IoU of forward and backward run
# Frames around a proposed one in which no second one is proposed, as a share of the distance to the
# next keyframe: a correction changes the track up to there.
_APART: Final = 0.5
_LEAST_APART: Final = 5  # frames


@dataclass(frozen=True)
class Doubt:
    """A frame that a person should look at.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    frame : int
    target : int
        From 1.
    doubt : float
        0..1, larger for frames that are more likely wrong.
    reason : str
        In words: "forward and backward disagree (IoU .21)", "score .18", "lost".
    """

    frame: int
    target: int
    doubt: float
    reason: str


def doubtful_frames(section: Section, track: Blend, target: int = 1, most: int = 5) -> list[Doubt]:
    """The frames of a section in which its track is most likely wrong, the worst first.

    A frame is doubtful if the target is lost there, if its score is low, or if the forward and the
    backward run disagree. Among those, frames that are far from each other and from keyframes are
    chosen; of equally doubtful ones, those farthest from keyframes.

    Parameters
    ----------
    section : Section
    track : Blend
        Of this section.
    target : int
        Its number, which is returned.
    most : int
        Largest number of frames.
    """
    frames = np.arange(section.first, section.last + 1)
    keys = np.array([each.frame for each in section.keyframes])
    distance = np.abs(frames[:, None] - keys).min(axis=1)
    by_score = np.where(track.lost, 1.0, 1.0 - track.scores)
    disagreement = 1.0 - np.nan_to_num(track.agreement, nan=1.0)
    doubt = np.maximum(by_score, disagreement)
    is_doubtful = (
        track.lost | (track.scores < _LOW_SCORE) | (disagreement > 1 - _LOW_AGREEMENT)
    ) & (distance > 0)
    found: list[Doubt] = []
    for index in np.lexsort((-distance, -doubt)):
        if len(found) == most:
            break
        apart = max(_LEAST_APART, _APART * distance[index])
        is_near = any(abs(each.frame - frames[index]) < apart for each in found)
        if is_doubtful[index] and not is_near:
            reason = _reason(track, int(index))
            found.append(Doubt(int(frames[index]), target, float(doubt[index]), reason))
    return found


def _reason(track: Blend, index: int) -> str:
    if track.lost[index]:
        return "lost"
    agreement, score = track.agreement[index], track.scores[index]
    if not np.isnan(agreement) and 1 - agreement >= 1 - score:
        return f"forward and backward disagree (IoU {agreement:.2f})"
    return f"score {score:.2f}"
