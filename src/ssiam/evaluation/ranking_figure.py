"""Fig. 6 of the paper, read as: the AR plot of VOT, and elsewhere the success plot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from ssiam.evaluation.canvas import COLORS, SMALL, NothingToDrawError, bare, canvas, png
from ssiam.evaluation.eao import INTERVALS
from ssiam.evaluation.success import THRESHOLDS, mean_success
from ssiam.evaluation.summaries import Summaries, Summary, success_of
from ssiam.evaluation.vot_toolkit import ar_point, scores
from ssiam.stabilize import METHODS, StabilizerConfig

# By way of steadying; results of other programs are drawn as "off".
_LINES: Final = {"off": "--", "paper": "-", "literal": ":", "predict": "-."}
_MARKERS: Final = {"off": "o", "paper": "s", "literal": "^", "predict": "D"}
_DEFAULTS: Final = (None, *(StabilizerConfig(method) for method in METHODS))


def figure6(found: Summaries) -> bytes:
    """Every tracker alone and steadied, as a PNG; one colour a tracker.

    On a year of VOT the AR plot by vot-toolkit's conventions: up and to the right is better. On
    another dataset the share of frames whose overlap is above each threshold, in one-pass runs if
    every entry has them, else in supervised ones.

    Raises
    ------
    NothingToDrawError
        There are no results of a default way of steadying.
    MissingExtraError
        matplotlib is not installed.
    """
    chosen = [each for each in found.entries if each.config in _DEFAULTS]
    if found.year is not None:
        chosen = [each for each in chosen if each.scores is not None]
    if not chosen:
        raise NothingToDrawError("no tracker has results by which they could be ranked")
    figure, panels = canvas((8, 4.6), (1, 1))
    panel = panels[0, 0]
    if found.year is None:
        _draw_success(panel, chosen)
    else:
        _draw_ar(panel, chosen, found.year)
    bare(panel)
    panel.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False, fontsize=SMALL)
    return png(figure)


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
        look = {"marker": _MARKERS[method], "ec": color, "fc": face}
        panel.scatter([x], [y], s=70, lw=1.8, label=each.label, **look)
    panel.set(xlabel="robustness: share of targets still held after 30 frames")
    panel.set(ylabel="accuracy: mean overlap")


def _colors(chosen: Sequence[Summary]) -> list[str]:
    trackers = list(dict.fromkeys(each.tracker for each in chosen))
    return [COLORS[trackers.index(each.tracker) % len(COLORS)] for each in chosen]


def _method(summary: Summary) -> str:
    return "off" if summary.config is None else summary.config.stabilize
