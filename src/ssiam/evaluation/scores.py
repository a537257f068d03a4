"""`Scores`: the five numbers of a supervised run over a dataset."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scores:
    """Measures of one tracker under one toolkit's conventions.

    Attributes
    ----------
    accuracy : float
        Mean overlap while tracking, 0 to 1.
    robustness : float
        How often the target is lost: per 100 frames under pysot's conventions, per sequence
        under vot-toolkit's.
    eao : float
        Expected average overlap, 0 to 1; nan if no run is long enough for it.
    lost : float
        Targets lost, the mean of all repetitions.
    frames : int
        Frames of one repetition.
    """

    accuracy: float
    robustness: float
    eao: float
    lost: float
    frames: int
