"""All trackers in one plot: accuracy and robustness, success, or the curve of EAO."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from ssiam.evaluation.measures.eao import INTERVALS
from ssiam.evaluation.measures.success import THRESHOLDS, mean_success
from ssiam.evaluation.measures.vot_toolkit import ar_point, scores
from ssiam.evaluation.paper.canvas import (
    COLORS,
    GRAY,
    SMALL,
    NothingToDrawError,
    canvas,
    png,
    style_axes,
)
from ssiam.evaluation.paper.summary import Summaries, Summary, success_of
from ssiam.stabilize import METHODS, StabilizerConfig

# By stabilization method; results of other programs are drawn as "off".
_LINES: Final = {"off": "--", "paper": "-", "literal": ":", "predict": "-."}
_MARKERS: Final = {"off": "o", "paper": "s", "literal": "^", "predict": "D"}
_DEFAULTS: Final = (None, *(StabilizerConfig(method) for method in METHODS))
_SIZE: Final = (8, 4.6)  # inches


def draw_ranking(found: Summaries) -> bytes:
    """Ranking of all trackers with default settings, as a PNG; one color per tracker.

    On a year of VOT: the AR plot by vot-toolkit's conventions, where up and right are better. On
    other datasets: the success plot of one-pass runs, or of supervised runs if an entry lacks them.

    Raises
    ------
    NothingToDrawError
        No tracker with default settings has results.
    """
    chosen = _default_entries(found)
    if found.year is not None:
        chosen = [each for each in chosen if each.scores is not None]
    if not chosen:
        raise NothingToDrawError("no tracker has results to rank")
    figure, panels = canvas(_SIZE, (1, 1))
    panel = panels[0, 0]
    if found.year is None:
        _draw_success(panel, chosen)
    else:
        _draw_ar(panel, chosen, found.year)
    _finish(panel)
    return png(figure)


def draw_eao_curve(found: Summaries) -> bytes:
    """The expected overlap by length for trackers with default settings, as a PNG.

    On a year of VOT the interval whose mean is EAO is gray, and EAO is in the legend.

    Raises
    ------
    NothingToDrawError
        No tracker with default settings has supervised runs.
    """
    chosen = [each for each in _default_entries(found) if each.eao_curve is not None]
    if not chosen:
        raise NothingToDrawError("no tracker has supervised runs with known frame sizes")
    figure, panels = canvas(_SIZE, (1, 1))
    panel = panels[0, 0]
    if found.year is not None:
        low, high = INTERVALS[found.year]
        panel.axvspan(low, high, color=GRAY, alpha=0.6, lw=0, zorder=0)
    for each, color in zip(chosen, _colors(chosen), strict=True):
        curve, of_runs = each.eao_curve, each.scores
        label = each.label
        if of_runs is not None and not np.isnan(of_runs.eao):
            label += f"  {of_runs.eao:.3f}"
        if curve is not None:
            lengths = np.arange(1, len(curve) + 1)
            panel.plot(lengths, curve, color=color, ls=_LINES[_method(each)], label=label)
    panel.set(xlabel="frames from the start", ylabel="expected average overlap", ylim=(0, 1))
    panel.set_xlim(left=1)
    _finish(panel)
    return png(figure)


def _default_entries(found: Summaries) -> list[Summary]:
    return [each for each in found.entries if each.config in _DEFAULTS]


def _finish(panel: Any) -> None:
    style_axes(panel)
    panel.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False, fontsize=SMALL)


def _draw_success(panel: Any, chosen: Sequence[Summary]) -> None:
    one_pass = all(each.one_pass for each in chosen)
    for each, color in zip(chosen, _colors(chosen), strict=True):
        runs = (each.one_pass if one_pass else each.supervised).values()
        mean = mean_success([success_of(tracked, run) for tracked in runs for run in tracked.runs])
        label = f"{each.label}  {mean.auc:.3f}"
        panel.plot(THRESHOLDS, mean.curve, color=color, ls=_LINES[_method(each)], label=label)
    panel.set(xlabel="overlap threshold", xlim=(0, 1), ylim=(0, 1))
    panel.set(ylabel=f"share of frames, {'one-pass' if one_pass else 'supervised'} runs")


def _draw_ar(panel: Any, chosen: Sequence[Summary], year: int) -> None:
    for each, color in zip(chosen, _colors(chosen), strict=True):
        tracked = list(each.supervised.values())
        x, y = ar_point(scores(tracked, INTERVALS[year]), len(tracked))
        method = _method(each)
        face = "none" if method == "off" else color
        style = {"marker": _MARKERS[method], "ec": color, "fc": face}
        panel.scatter([x], [y], s=70, lw=1.8, label=each.label, **style)
    panel.set(xlabel="robustness: share of targets still tracked after 30 frames")
    panel.set(ylabel="accuracy: mean overlap")


def _colors(chosen: Sequence[Summary]) -> list[str]:
    trackers = list(dict.fromkeys(each.tracker for each in chosen))
    return [COLORS[trackers.index(each.tracker) % len(COLORS)] for each in chosen]


def _method(summary: Summary) -> str:
    return "off" if summary.config is None else summary.config.stabilize
