"""A picture of speed against error of camera-motion estimators, with the Pareto front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from benchmarks.motion.clips import NO_BOX, REAL
from benchmarks.motion.report import FAR, Pool, Score, grouped

_COLUMNS = 3  # panels of the picture side by side
_MARKERS = "osD^vP*Xh<>p"

Points: TypeAlias = dict[str, tuple[float, float]]  # (ms, error) by estimator


def draw(scores: Sequence[Score], path: Path) -> None:
    """Write a picture of speed against error: a panel for each drawn scene, two for real footage.

    Estimators that failed on one of a panel's clips are left out of it.
    """
    import matplotlib.pyplot as plt

    panels = _panels(scores)
    looks = {
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
    figure.get_layout_engine().set(h_pad=0.12, w_pad=0.08)
    for axes in grid.flat[len(panels) :]:
        axes.set_axis_off()
    for axes, ((title, unit), points) in zip(grid.flat, panels.items(), strict=False):
        axes.set(title=title, xlabel="ms a frame", ylabel=unit)
        _scatter(axes, points, looks)
    handles = [plt.Line2D([], [], label=name, **look) for name, look in looks.items()]
    grid.flat[-1].legend(handles=handles, loc="center", frameon=False)
    figure.canvas.draw()  # settles the sizes that the names are fitted to
    figure.set_layout_engine("none")
    for axes, points in zip(grid.flat, panels.values(), strict=False):
        _name_front(axes, points)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def _panels(scores: Sequence[Score]) -> dict[tuple[str, str], Points]:
    """What each panel shows, by its title and the name of its error."""
    panels: dict[tuple[str, str], Points] = {}
    for place, here in grouped(scores, "place").items():
        for name, group in grouped(here, "estimator").items():
            pool = Pool(group)
            if place == REAL and not pool.failed:
                beyond = max(pool.beyond, 50 / pool.frames)  # none is drawn as half a frame
                for unit, error in (
                    ("median error, % of the width", pool.error),
                    (f"frames beyond {FAR:g} % of the width, %", beyond),
                ):
                    panels.setdefault(("real footage, shaken", unit), {})[name] = pool.ms, error
            for scene, clips in grouped(group, "scene").items():
                pool = Pool(clips)
                if place != REAL and not scene.endswith(NO_BOX) and not pool.failed:
                    key = f"{place}, {scene}", "error of the corners, px"
                    panels.setdefault(key, {})[name] = pool.ms, pool.error
    return panels


def pareto_front(points: Points) -> list[str]:
    """Names of the points that no other beats in both speed and error, the fastest first."""
    front: list[str] = []
    for name in sorted(points, key=lambda name: points[name]):
        if not front or points[name][1] < points[front[-1]][1]:
            front.append(name)
    return front


def _scatter(axes: Any, points: Points, looks: dict[str, dict[str, Any]]) -> None:
    """Markers and the Pareto front, with room on the left and below for the front's names."""
    from matplotlib import ticker

    ms, error = zip(*points.values(), strict=True)
    axes.loglog(*zip(*(points[name] for name in pareto_front(points)), strict=True), color="0.7")
    for name, point in points.items():
        axes.plot(*point, **looks[name])
    axes.set(xlim=_span(ms, 0.47, 0.08), ylim=_span(error, 0.25, 0.08))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(ticker.NullLocator())


def _span(values: Sequence[float], before: float, after: float) -> tuple[float, float]:
    """Limits of a logarithmic axis that leave these shares of it free."""
    low, high = math.log10(min(values)), math.log10(max(values))
    span = max(high - low, 0.3) / (1 - before - after)
    return 10 ** (low - before * span), 10 ** (high + after * span)


def _name_front(axes: Any, points: Points) -> None:
    """Write each name of the front left of and below its marker, where no marker can be."""
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
