"""Plot of lost targets against the strength of the shake, from the runs of run.py."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

from benchmarks.shake.records import NO_SHAKE, Runs, ShakeRun
from benchmarks.shake.report import KINDS, TRUE_MOTION, by, comparable, lost, per_1000
from ssiam.evaluation.paper.canvas import BLUE, COLORS, ORANGE, SMALL, canvas, png, style_axes

_COLUMNS: Final = 3
_WIDTH: Final = 7.7  # inches: 1000 pixels
_HEIGHT: Final = 2.75  # inches of a row of panels
_HEADER: Final = 0.85  # inches of title and legend
_GREEN: Final = COLORS[2]

# Label and style of each line.
_LINES: Final[dict[str, tuple[str, dict[str, Any]]]] = {
    "off": ("tracker alone", {"color": "0.45", "marker": "s"}),
    "paper": ("paper's stabilization", {"color": ORANGE, "marker": "^"}),
    "predict": ("predict", {"color": BLUE, "marker": "o", "linewidth": 2.6, "zorder": 3}),
    TRUE_MOTION: (
        "predict, true motion",
        {"color": _GREEN, "marker": "D", "linestyle": (0, (4, 2)), "markersize": 4},
    ),
}
_STYLE: Final = {"linewidth": 1.6, "markersize": 5.5, "clip_on": False}


def draw(runs: Runs, path: Path) -> None:
    """Write a plot with a panel for each tracker."""
    listed = [run for run in comparable(runs, [*_LINES]) if run.kind in (NO_SHAKE, *KINDS)]
    panels = by(sorted(listed, key=_order), lambda run: run.tracker)
    columns = min(_COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure, grid = canvas((_WIDTH, _HEADER + _HEIGHT * rows), (rows, columns), sharex=True)
    figure.get_layout_engine().set(w_pad=0.08, h_pad=0.06)
    for axes, (tracker, own) in zip(grid.flat, panels.items(), strict=False):
        _panel(axes, tracker, own)
    for axes in grid.flat[len(panels) :]:
        axes.set_axis_off()
    for axes in grid.flat[max(len(panels) - columns, 0) : len(panels)]:
        axes.set_xlabel("shake, % of the frame's width")
        axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel("lost targets per 1000 frames")
    _head(figure, grid.flat)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png(figure))


def _order(run: ShakeRun) -> tuple[bool, str]:
    """NanoTrack first, then by name."""
    return not run.tracker.startswith("nanotrack"), run.tracker


def _panel(axes: Any, tracker: str, own: Runs) -> None:
    """The lines of a tracker."""
    style_axes(axes)
    axes.set_title(tracker.replace("_", " "), fontsize=SMALL + 2, fontweight="bold", loc="left")
    strengths = sorted({run.strength for run in own})
    settings = by(own, lambda run: run.setting)
    for setting, (label, style) in _LINES.items():
        if setting in settings:
            rates = [
                per_1000([run for run in settings[setting] if run.strength == strength])
                for strength in strengths
            ]
            percent = [100 * strength for strength in strengths]
            axes.plot(percent, rates, label=label, **{**_STYLE, **style})
    axes.set_xticks([100 * strength for strength in strengths])
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_ylim(bottom=0)
    axes.set_xlim(0, 100 * max(strengths) * 1.02)
    _gain(axes, settings, max(strengths))


def _gain(axes: Any, settings: dict[str, Any], strongest: float) -> None:
    """Arrow with the factor between off and predict under the strongest shake."""
    ends = {
        name: [run for run in settings.get(name, []) if run.strength == strongest]
        for name in ("off", "predict")
    }
    if not all(lost(end) for end in ends.values()):
        return
    high, low = (per_1000(end) for end in ends.values())
    if high <= low:
        return
    at = 100 * strongest * 1.06
    arrow = {"arrowstyle": "->", "color": BLUE, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (at, low), (at, high), arrowprops=arrow, annotation_clip=False)
    label = {"textcoords": "offset points", "va": "center", "annotation_clip": False}
    text, middle = f"{high / low:.1f}×\nfewer", (at, (high + low) / 2)
    axes.annotate(text, middle, (4, 0), size=SMALL, weight="bold", color=BLUE, **label)


def _head(figure: Any, panels: Any) -> None:
    """The title, and below it a common legend of all panels."""
    drawn = (zip(*axes.get_legend_handles_labels(), strict=True) for axes in panels)
    lines = {label: handle for pairs in drawn for handle, label in pairs}
    labels = [label for label, _ in _LINES.values() if label in lines]
    figure.legend(
        [lines[label] for label in labels],
        labels,
        loc="outside upper center",
        ncols=len(labels),
        frameon=False,
        fontsize=SMALL + 1,
        title="Targets lost while the camera shakes",
        title_fontproperties={"size": SMALL + 4, "weight": "bold"},
    )
