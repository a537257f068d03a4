"""The page of the leaderboard, from the result files of `ssiam bench`."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from ssiam.datasets import open_dataset
from ssiam.evaluation.paper.canvas import BLUE, COLORS, ORANGE, canvas, png, style_axes
from ssiam.evaluation.paper.cells import Table
from ssiam.evaluation.paper.figures import Figure
from ssiam.evaluation.paper.page import Section, write_page
from ssiam.evaluation.paper.summary import Summary, summarize
from ssiam.evaluation.runs.shaken_results import read_shake, shaken_as
from ssiam.stabilize import METHODS

_TITLE: Final = "Shake leaderboard"
_EXPLANATION: Final = (
    "Lost targets, with a restart five frames after each (VOT), and success in one pass (area "
    "under OTB's curve), of trackers alone (off), with the paper's stabilization and with "
    "predict. The shake is synthetic; its strength is the standard deviation of the shifts as a "
    "share of the frame's width. Kinds and seeds of shake of one strength are summed, and their "
    "success is averaged. Frames per second are those of the run, one thread for each process."
)
_STYLES: Final = {
    "off": ("0.45", "s", "alone"),
    "paper": (ORANGE, "^", "paper's stabilization"),
    "predict": (BLUE, "o", "predict"),
}
_COLUMNS: Final = 3  # of panels
_PANEL_WH: Final = (2.6, 2.3)  # inches
_HEADER: Final = 0.5  # inches, of the legend
_LEGEND_WIDTH: Final = 4.4  # inches


@dataclass
class _Cell:
    """The runs of one tracker and stabilization under shake of one strength."""

    lost: list[float] = field(default_factory=list)  # by sequence and path
    frames: int = 0
    success: list[float] = field(default_factory=list)  # by path
    fps: list[float] = field(default_factory=list)


Row = tuple[str, str]  # tracker and stabilization
Cells = Mapping[Row, Mapping[float, _Cell]]  # by strength


def write_leaderboard(out: Path, datasets: Mapping[str, Path]) -> list[Path]:
    """Write tables.md, tables.html and the plots; returns the written files."""
    sections = [_section(name, out / "raw" / path.name, path) for name, path in datasets.items()]
    return write_page(out, sections, _EXPLANATION, title=_TITLE)


def _section(name: str, results: Path, dataset: Path) -> Section:
    """The tables and plots of one dataset."""
    found: dict[Row, dict[float, _Cell]] = defaultdict(lambda: defaultdict(_Cell))
    notes: list[str] = []
    for folder in [results, *sorted(results.glob("shake-*"))]:
        shake = read_shake(folder)
        summaries = summarize(folder, shaken_as(folder, open_dataset(dataset)))
        notes += summaries.notes
        for entry in summaries.entries:
            if entry.config is not None:
                cells = found[entry.tracker, entry.config.stabilize]
                _add(cells[shake.strength if shake else 0.0], entry)
    strengths = sorted({strength for cells in found.values() for strength in cells})
    rank = {tracker: _rank(found, tracker, strengths) for tracker, _ in found}
    rows = sorted(found, key=lambda row: (rank[row[0]], row[0], METHODS.index(row[1])))
    plots = [
        _plot(name, "lost", "lost targets per 1000 frames", found, rows, strengths, _lost_rate),
        _plot(name, "success", "success", found, rows, strengths, _success),
    ]
    return Section(name, [_table(name, found, rows, strengths)], plots, notes)


def _add(cell: _Cell, entry: Summary) -> None:
    cell.lost += entry.lost.values()
    cell.frames += sum(len(each.sequence) for each in entry.supervised.values())
    if entry.one_pass:
        cell.success.append(entry.success.auc)
    if not math.isnan(entry.fps):
        cell.fps.append(entry.fps)


def _rank(found: Cells, tracker: str, strengths: Iterable[float]) -> float:
    """Of a tracker: the least lost targets of its rows, all strengths summed."""
    own = [cells for (name, _), cells in found.items() if name == tracker]
    return min(sum(sum(cells[s].lost) for s in strengths if s in cells) for cells in own)


def _table(name: str, found: Cells, rows: Sequence[Row], strengths: Sequence[float]) -> Table:
    columns = [f"{100 * strength:g} %" for strength in strengths]
    head = (
        *("tracker", "stabilization"),
        *(f"lost, {each}" for each in columns),
        *(f"success, {each}" for each in columns),
        "fps",
    )
    lines = []
    for row in rows:
        cells = [found[row].get(strength, _Cell()) for strength in strengths]
        speeds = [speed for cell in cells for speed in cell.fps]
        lines.append(
            (
                *row,
                *(f"{sum(cell.lost):.0f}" if cell.lost else "" for cell in cells),
                *(f"{_success(cell):.3f}" if cell.success else "" for cell in cells),
                f"{sum(speeds) / len(speeds):.0f}" if speeds else "",
            )
        )
    return Table(f"Lost targets and success, {name}", head, lines)


def _lost_rate(cell: _Cell) -> float:
    """Lost targets per 1000 frames."""
    return 1000 * sum(cell.lost) / cell.frames if cell.frames else math.nan


def _success(cell: _Cell) -> float:
    return sum(cell.success) / len(cell.success) if cell.success else math.nan


def _plot(
    dataset: str,
    name: str,
    label: str,
    found: Cells,
    rows: Sequence[Row],
    strengths: Sequence[float],
    measure: Callable[[_Cell], float],
) -> Figure:
    """A measure against the strength of the shake, a panel for each tracker."""
    trackers = list(dict.fromkeys(tracker for tracker, _ in rows))
    columns = min(_COLUMNS, len(trackers))
    lines = -(-len(trackers) // columns)
    width, height = _PANEL_WH
    size = (max(columns * width, _LEGEND_WIDTH), lines * height + _HEADER)
    figure, grid = canvas(size, (lines, columns), sharex=True, sharey=True)
    for axes, tracker in zip(grid.flat, trackers, strict=False):
        style_axes(axes)
        axes.set_title(tracker, loc="left", fontweight="bold")
        for row in rows:
            if row[0] == tracker:
                color, marker, text = _STYLES.get(row[1], (COLORS[2], "v", row[1]))
                values = [measure(found[row].get(each, _Cell())) for each in strengths]
                percent = [100 * each for each in strengths]
                axes.plot(percent, values, color=color, marker=marker, label=text, clip_on=False)
    grid.flat[0].set_ylim(bottom=0)  # of all panels, whose limits are by now those of all lines
    for axes in grid.flat[len(trackers) :]:
        axes.set_axis_off()
    for axes in grid.flat[max(len(trackers) - columns, 0) : len(trackers)]:
        axes.set_xlabel("shake, % of the width")
        axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        axes.set_ylabel(label)
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    title = f"{label[0].upper()}{label[1:]} under shake, {dataset}"
    caption = "Each point is the sum or mean over all sequences, kinds and paths of shake."
    return Figure(f"{name}-{dataset.replace(' ', '-')}", title, caption, png(figure))
