"""Plot of speed against error of camera-motion estimators, with the Pareto front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from benchmarks.motion.clips import NO_BOX, REAL
from benchmarks.motion.report import FAR, Pool, Score, grouped

_COLUMNS = 3
_MARKERS = "osD^vP*Xh<>p"

Points: TypeAlias = dict[str, tuple[float, float]]  # (ms, error) by estimator


def draw(scores: Sequence[Score], path: Path) -> None:
    """Plot speed against error: a panel for each drawn scene, and two for real footage.

    An estimator that failed on a clip is left out of the panels with that clip.
    """
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D

    panels = _panels(scores)
    styles: dict[str, dict[str, Any]] = {
        name: {
            "marker": _MARKERS[index % len(_MARKERS)],
            "color": f"C{index % 10}",
            "markerfacecolor": f"C{index % 10}" if name.startswith("ssiam") else "none",
            "linestyle": "",
            "markersize": 8,
        }
        for index, name in enumerate(grouped(scores, "estimator"))
    }
    rows = math.ceil((len(panels) + 1) / _COLUMNS)
    figure, grid = plt.subplots(rows, _COLUMNS, figsize=(13, 4.2 * rows), layout="constrained")
    layout: Any = figure.get_layout_engine()
    layout.set(h_pad=0.12, w_pad=0.08)
    for axes in grid.flat[len(panels) :]:
        axes.set_axis_off()
    for axes, ((title, unit), points) in zip(grid.flat, panels.items(), strict=False):
        axes.set(title=title, xlabel="ms a frame", ylabel=unit)
        _scatter(axes, points, styles)
    handles = [Line2D([], [], label=name, **style) for name, style in styles.items()]
    grid.flat[-1].legend(handles=handles, loc="center", frameon=False)
    figure.canvas.draw()  # fixes the sizes that the labels are fitted to
    figure.set_layout_engine("none")
    for axes, points in zip(grid.flat, panels.values(), strict=False):
        _label_front(axes, points)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def _panels(scores: Sequence[Score]) -> dict[tuple[str, str], Points]:
    """Points of each panel, by its title and the label of its error axis."""
    panels: dict[tuple[str, str], Points] = {}
    for source, here in grouped(scores, "source").items():
        for name, group in grouped(here, "estimator").items():
            pool = Pool(group)
            if source == REAL and not pool.failed:
                beyond = max(pool.beyond, 50 / pool.frames)  # no frame is drawn as half a frame
                for unit, error in (
                    ("median error, % of the width", pool.error),
                    (f"frames beyond {FAR:g} % of the width, %", beyond),
                ):
                    panels.setdefault(("real footage, shaken", unit), {})[name] = pool.ms, error
            for scene, clips in grouped(group, "scene").items():
                pool = Pool(clips)
                if source != REAL and not scene.endswith(NO_BOX) and not pool.failed:
                    key = f"{source}, {scene}", "error of the corners, px"
                    panels.setdefault(key, {})[name] = pool.ms, pool.error
    return panels


def pareto_front(points: Points) -> list[str]:
    """Names of the points on the Pareto front of speed and error, the fastest first."""
    front: list[str] = []
    for name in sorted(points, key=lambda name: points[name]):
        if not front or points[name][1] < points[front[-1]][1]:
            front.append(name)
    return front


def _scatter(axes: Any, points: Points, styles: dict[str, dict[str, Any]]) -> None:
    """Markers and the Pareto front, with room at the left and below for its labels."""
    from matplotlib import ticker

    ms, error = zip(*points.values(), strict=True)
    axes.loglog(*zip(*(points[name] for name in pareto_front(points)), strict=True), color="0.7")
    for name, point in points.items():
        axes.plot(*point, **styles[name])
    axes.set(xlim=_span(ms, 0.47, 0.08), ylim=_span(error, 0.25, 0.08))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(ticker.NullLocator())


def _span(values: Sequence[float], before: float, after: float) -> tuple[float, float]:
    """Limits of a logarithmic axis with these shares of it free at the ends."""
    low, high = math.log10(min(values)), math.log10(max(values))
    span = max(high - low, 0.3) / (1 - before - after)
    return 10 ** (low - before * span), 10 ** (high + after * span)


def _label_front(axes: Any, points: Points) -> None:
    """Label the points of the front left of and below their markers, where there are no markers."""
    taken: list[Any] = []
    for name in pareto_front(points):
        label = axes.annotate(
            name,
            points[name],
            (-7, -4),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=9,
            arrowprops={"arrowstyle": "-", "color": "0.7", "relpos": (1, 1), "shrinkB": 5},
        )
        box = label.get_window_extent()
        above = [other.y0 for other in taken if other.x1 > box.x0]
        down = max(box.y1 - min(above, default=box.y1), 0)
        label.xyann = (-7, -4 - down * 72 / axes.figure.dpi)
        label.arrow_patch.set_visible(down > 0)
        taken.append(box.translated(0, -down))
