"""Presets: the benchmark runs behind the paper's tables, for the available trackers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

from ssiam.errors import check_choice
from ssiam.evaluation.measures.eao import known_year
from ssiam.evaluation.paper.published import ABLATION_YEAR, PAPER_TRACKERS
from ssiam.evaluation.runs.entries import DEFAULT_OPTIONS, Entry, options_for
from ssiam.motion import KEYPOINTS
from ssiam.runtime import RuntimeOptions
from ssiam.runtime.model_zoo import how_to_get_weights
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import TRACKERS, weights_path

PresetName: TypeAlias = Literal["table1", "table2", "table3", "table4"]
PRESETS: Final[tuple[PresetName, ...]] = get_args(PresetName)

_OFF, _PAPER = StabilizerConfig("off"), StabilizerConfig("paper")

# Table 2 by keypoint generator, the paper's five first.
GENERATORS: Final[dict[str, StabilizerConfig]] = {
    name: replace(_PAPER, keypoints=name)
    for name in sorted(KEYPOINTS, key=lambda name: name == "direct")
}
_ANGLES: Final = (0.1, 0.3, 0.5, 1.0)  # THa, without a unit in the paper
# Table 3 by threshold and value; all other thresholds keep the paper's values. The text
# before the comma is the key of `TABLE3`.
THRESHOLDS: Final[dict[str, dict[float, StabilizerConfig]]] = {
    "THx1 = 2 THy1, px": {x: _PAPER.with_options(thx1=x, thy1=x / 2) for x in (60.0, 80.0, 100.0)},
    "THx2 = 2 THy2, px/frame": {
        x: _PAPER.with_options(thx2=x, thy2=x / 2) for x in (20.0, 40.0, 80.0)
    },
    "THa, rad": {angle: _PAPER.with_options(tha=angle) for angle in _ANGLES},
    "THa, degrees": {angle: _PAPER.with_options(tha=angle, tha_unit="deg") for angle in _ANGLES},
}
_CONFIGS: Final[dict[PresetName, tuple[StabilizerConfig, ...]]] = {
    "table1": (_OFF, _PAPER),
    "table2": (_OFF, *GENERATORS.values()),
    # A dict removes duplicates: the paper's values are in the rows of every threshold.
    "table3": tuple(dict.fromkeys(each for row in THRESHOLDS.values() for each in row.values())),
    "table4": (_OFF, _PAPER),
}

# Years of VOT that a table needs.
_YEARS: Final[dict[PresetName, tuple[int, ...]]] = {
    "table1": (2016, 2018, 2019),
    "table2": (ABLATION_YEAR,),
    "table3": (ABLATION_YEAR,),
    "table4": (ABLATION_YEAR,),
}
# Trackers that need no weights.
_WITHOUT_WEIGHTS: Final = ("csrt", "kcf")


@dataclass(frozen=True)
class Preset:
    """The runs for a table of the paper.

    Attributes
    ----------
    entries : list of Entry
    missing : list of str
        A line for each tracker and dataset of the paper that is not available, with its source and
        the command that brings it.
    """

    entries: list[Entry]
    missing: list[str]


def preset(
    name: str,
    trackers: Sequence[str] | None,
    weights: Mapping[str, Path],
    datasets: Iterable[str] | None = None,
    options: RuntimeOptions = DEFAULT_OPTIONS,
) -> Preset:
    """The runs for a table of the paper.

    Parameters
    ----------
    name : {"table1", "table2", "table3", "table4"}
        1: every tracker alone and stabilized. 2: the keypoint generators. 3: the thresholds of
        eq. 6, varied one at a time. 4: as 1, for lost targets by sequence.
    trackers : sequence of str, optional
        Defaults to csrt, kcf, the trackers in `weights`, and the paper's with imported weights.
    weights : mapping of str to Path
        By the name of the tracker.
    datasets : iterable of str, optional
        Names of the datasets that will be run. With None, missing datasets are not listed.
    options : RuntimeOptions
        How the networks run, and the threads of each run.

    Raises
    ------
    ArgumentError
        Unknown preset or tracker.
    """
    table = check_choice("preset", name, PRESETS)
    imported = [each for each in PAPER_TRACKERS.values() if weights_path(each) is not None]
    available = [each for each in TRACKERS if each in weights or each in imported]
    names = [*_WITHOUT_WEIGHTS, *available]
    chosen = [check_choice("tracker", each, TRACKERS) for each in trackers or names]
    missing = [
        _missing_tracker(title, name, name in available)
        for title, name in PAPER_TRACKERS.items()
        if name not in chosen
    ]
    if datasets is not None:
        missing += _missing_data(table, {known_year(each) for each in datasets})
    return Preset(
        [
            Entry(each, config, weights.get(each), options_for(each, options))
            for each in chosen
            for config in _CONFIGS[table]
        ],
        missing,
    )


def _missing_tracker(title: str, name: str, has_weights: bool) -> str:
    if has_weights:
        return f"{title}: its weights are here; add {name} to --trackers"
    return f"{title}: {how_to_get_weights(name)}"


def _missing_data(table: PresetName, years: set[int | None]) -> list[str]:
    return [
        f"VOT{year}: not among the datasets; download it from votchallenge.net"
        for year in _YEARS[table]
        if year not in years
    ]
