"""Scores of camera-motion estimators: Markdown tables, and a picture of speed against error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from motion_clips import NO_BOX, REAL

FAR = 1.0  # % of the width, beyond which an estimate is useless
_COLUMNS = 3  # panels of the picture side by side
_MARKERS = "osD^vP*Xh<>p"

Points: TypeAlias = dict[str, tuple[float, float]]  # (ms, error) by estimator


@dataclass(frozen=True, eq=False)
class Score:
    """An estimator on one clip.

    Attributes
    ----------
    estimator, place, scene, clip : str
        Its name, and those of the clip.
    errors : (N,) float64
        Mean corner distance of each frame; pixels, or % of the width on real footage.
    ms : float, optional
        Median milliseconds a frame.
    reliable : float, optional
        Share of the frames that the estimator itself called reliable.
    failed : str
        Why there is no result: no error, no time.
    """

    estimator: str
    place: str
    scene: str
    clip: str
    errors: np.ndarray
    ms: float | None = None
    reliable: float | None = None
    failed: str = ""

    def summary(self) -> dict[str, Any]:
        """Names, figures and failure, for a JSON file."""
        own = {key: value for key, value in vars(self).items() if key != "errors"}
        return vars(Pool([self])) | own


class Pool:
    """Scores of one estimator on some clips of one place, taken together.

    Attributes
    ----------
    failed, frames : int
        Number of clips without a result, and of frames counted; without frames there is no more.
    error : float
        Drawn scenes: mean over the clips of the RMS error, pixels. Real footage: median over the
        clips of the median error, % of the width.
    mean : float
        Mean error of all frames, those far off included.
    worst : float
        Largest error of a frame.
    beyond, beyond_worst : float
        Frames with an error above `FAR`, %: mean over the clips, and of the worst clip.
    ms : float
        Median over the clips.
    """

    def __init__(self, scores: Iterable[Score]) -> None:
        scores = list(scores)
        done = [score for score in scores if not score.failed]
        self.failed = len(scores) - len(done)
        self.frames = sum(len(score.errors) for score in done)
        if not done:
            return
        if done[0].place == REAL:
            self.error = float(np.median([np.median(score.errors) for score in done]))
        else:
            self.error = float(np.mean([np.sqrt(np.mean(score.errors**2)) for score in done]))
        self.mean = float(np.mean(np.concatenate([score.errors for score in done])))
        beyond = [100 * float((score.errors > FAR).mean()) for score in done]
        self.worst = float(max(score.errors.max() for score in done))
        self.beyond, self.beyond_worst = float(np.mean(beyond)), max(beyond)
        self.ms = float(np.median([score.ms for score in done]))

    def show(self, form: str) -> str:
        """`form`, filled with this pool's figures and the number of clips that failed."""
        if not self.frames:
            return "failed"
        return form.format(self) + (f", {self.failed} failed" if self.failed else "")


def _by(scores: Iterable[Score], attribute: str) -> dict[str, list[Score]]:
    """Scores by an attribute, in the order of its values' first appearance."""
    groups: dict[str, list[Score]] = {}
    for score in scores:
        groups.setdefault(getattr(score, attribute), []).append(score)
    return groups


def tables(scores: Sequence[Score], baseline: str, by_sequence: Sequence[str]) -> str:
    """All tables of a run.

    Parameters
    ----------
    scores : sequence of Score
    baseline : str
        The estimator that the others are compared with.
    by_sequence : sequence of str
        Estimators whose figures on real footage are also told sequence by sequence.
    """
    parts = []
    for place, here in _by(scores, "place").items():
        estimators = _by(here, "estimator")
        title, form = f"{place}: c (worst frame), px", "{0.error:.2f} ({0.worst:.1f})"
        if place == REAL:
            title = f"real: median, % of width / frames beyond {FAR:g} % (worst sequence)"
            form = "{0.error:.3f} / {0.beyond:.1f} % ({0.beyond_worst:.0f} %)"
        parts.append(_figures(title, estimators, form))
        if baseline in estimators:
            parts.append(_ratios(place, estimators, baseline))
        for name in by_sequence:
            if place == REAL and name in estimators:
                title = f"{name}: median, % of width / frames beyond {FAR:g} %"
                form = "{0.error:.2f} / {0.beyond:.0f} %"
                parts.append(_figures(title, _by(estimators[name], "clip"), form))
    return "\n\n".join(parts)


def _figures(title: str, rows: dict[str, list[Score]], form: str) -> str:
    """A row for each group of scores, a column for each scene, and the time."""
    return _table(
        title,
        rows,
        lambda group, scene: Pool(group if scene == "ms" else _by(group, "scene")[scene]).show(
            "{0.ms:.1f}" if scene == "ms" else form
        ),
        "ms",
    )


def _ratios(place: str, estimators: dict[str, list[Score]], baseline: str) -> str:
    bases = {scene: Pool(group) for scene, group in _by(estimators[baseline], "scene").items()}

    def ratio(group: list[Score], scene: str) -> str:
        pool, base = Pool(_by(group, "scene")[scene]), bases[scene]
        if not (pool.frames and base.frames):
            return "failed"
        shares = f"{base.ms / pool.ms:.1f} / {pool.error / base.error:.2f}"
        return shares + (f" / {pool.mean / base.mean:.2f}" if place == REAL else "")

    shares = "median / mean error" if place == REAL else "error"
    title = f"{place}: times faster than {baseline} / share of its {shares}"
    return _table(title, estimators, ratio)


def _table(
    title: str,
    rows: dict[str, list[Score]],
    cell: Callable[[list[Score], str], str],
    *more_columns: str,
) -> str:
    columns = [*_by(next(iter(rows.values())), "scene"), *more_columns]
    lines = [[title, *columns]]
    lines += [[name, *(cell(group, column) for column in columns)] for name, group in rows.items()]
    head, *body = ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join([head, "|---" * (len(columns) + 1) + "|", *body])


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
        for index, name in enumerate(_by(scores, "estimator"))
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
    for place, here in _by(scores, "place").items():
        for name, group in _by(here, "estimator").items():
            pool = Pool(group)
            if place == REAL and not pool.failed:
                beyond = max(pool.beyond, 50 / pool.frames)  # none is drawn as half a frame
                for unit, error in (
                    ("median error, % of the width", pool.error),
                    (f"frames beyond {FAR:g} % of the width, %", beyond),
                ):
                    panels.setdefault(("real footage, shaken", unit), {})[name] = pool.ms, error
            for scene, clips in _by(group, "scene").items():
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
