"""What a row of the paper's tables lacks: weights, data, or a run."""

from __future__ import annotations

from collections.abc import Iterable

from ssiam.evaluation.paper.presets import PresetName
from ssiam.runtime import MODEL_ZOO
from ssiam.runtime.model_zoo import how_to_get_weights
from ssiam.trackers.registry import imported_weights


def missing_result(label: str, preset: PresetName) -> str:
    """What is needed for results of ``Entry.label``: weights that are not imported, or the run."""
    tracker = label.rpartition("-")[0]
    if tracker in MODEL_ZOO and imported_weights(MODEL_ZOO[tracker]) is None:
        return f"weights of {tracker}"
    return f"run of --preset {preset}"


def how_to_get(missing: Iterable[str]) -> list[str]:
    """A line for each weights, dataset or run that is missing: where it comes from.

    Parameters
    ----------
    missing : iterable of str
        Cells such as "VOT2018, weights of siamfc".
    """
    needed = dict.fromkeys(part for cell in missing for part in cell.split(", ") if part)
    return [f"{each}: {_source(each)}" for each in needed]


def _source(needed: str) -> str:
    tracker = needed.removeprefix("weights of ")
    if tracker in MODEL_ZOO:
        return how_to_get_weights(tracker)
    if needed.startswith("run of "):
        return f"ssiam bench DATASET --out RESULTS {needed.removeprefix('run of ')}"
    return (
        "download it from votchallenge.net, and run ssiam bench and ssiam tables on it, with an "
        "--out of its own: the years of VOT have sequences of the same names"
    )
