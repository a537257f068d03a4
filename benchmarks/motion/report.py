"""Scores of camera-motion estimators, and Markdown tables of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.motion.clips import REAL

FAR = 1.0  # % of the width; an estimate with a larger error is useless


@dataclass(frozen=True, eq=False)
class Score:
    """Result of an estimator on one clip.

    Attributes
    ----------
    estimator, source, scene, clip : str
        Name of the estimator, and source, scene and name of the clip.
    errors : (N,) float64
        Mean corner distance of each frame; pixels, or % of the width on real footage.
    ms : float, optional
        Median milliseconds per frame.
    reliable : float, optional
        Share of the frames that the estimator reported as reliable.
    failed : str
        Reason of a failure, in which case there are no errors and times.
    """

    estimator: str
    source: str
    scene: str
    clip: str
    errors: NDArray[np.float64]
    ms: float | None = None
    reliable: float | None = None
    failed: str = ""

    def summary(self) -> dict[str, Any]:
        """Names, figures and failure, for a JSON file."""
        # The files have always called the source "place".
        fields = {
            "place" if key == "source" else key: value
            for key, value in vars(self).items()
            if key != "errors"
        }
        figures = vars(Pool([self]))
        known = {key: value for key, value in figures.items() if not math.isnan(value)}
        return known | fields


class Pool:
    """Aggregated scores of one estimator on clips of one source.

    Attributes
    ----------
    failed, frames : int
        Number of clips without a result, and of frames counted. The other attributes are nan
        without frames.
    error : float
        Drawn scenes: mean over the clips of the RMS error, pixels. Real footage: median over the
        clips of the median error, % of the width.
    mean : float
        Mean error of all frames, outliers included.
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
        self.error = self.mean = self.worst = float("nan")
        self.beyond = self.beyond_worst = self.ms = float("nan")
        if not done:
            return
        if done[0].source == REAL:
            self.error = float(np.median([np.median(score.errors) for score in done]))
        else:
            self.error = float(np.mean([np.sqrt(np.mean(score.errors**2)) for score in done]))
        self.mean = float(np.mean(np.concatenate([score.errors for score in done])))
        beyond = [100 * float((score.errors > FAR).mean()) for score in done]
        self.worst = float(max(score.errors.max() for score in done))
        self.beyond, self.beyond_worst = float(np.mean(beyond)), max(beyond)
        self.ms = float(np.median([score.ms for score in done if score.ms is not None]))

    def cell(self, form: str) -> str:
        """`form` filled with the figures, and the number of clips that failed."""
        if not self.frames:
            return "failed"
        return form.format(self) + (f", {self.failed} failed" if self.failed else "")


def grouped(scores: Iterable[Score], attribute: str) -> dict[str, list[Score]]:
    """Scores by the value of an attribute, in the order of first occurrence."""
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
        The estimator to compare the others with.
    by_sequence : sequence of str
        Estimators that get a table of real footage by sequence.
    """
    parts = []
    for source, here in grouped(scores, "source").items():
        estimators = grouped(here, "estimator")
        title, form = f"{source}: c (worst frame), px", "{0.error:.2f} ({0.worst:.1f})"
        if source == REAL:
            title = f"real: median, % of width / frames beyond {FAR:g} % (worst sequence)"
            form = "{0.error:.3f} / {0.beyond:.1f} % ({0.beyond_worst:.0f} %)"
        parts.append(_figures(title, estimators, form))
        if baseline in estimators:
            parts.append(_ratios(source, estimators, baseline))
        for name in by_sequence:
            if source == REAL and name in estimators:
                title = f"{name}: median, % of width / frames beyond {FAR:g} %"
                form = "{0.error:.2f} / {0.beyond:.0f} %"
                parts.append(_figures(title, grouped(estimators[name], "clip"), form))
    return "\n\n".join(parts)


def _figures(title: str, rows: dict[str, list[Score]], form: str) -> str:
    """A table with a row per group of scores, a column per scene, and one for the time."""
    return _table(
        title,
        rows,
        lambda group, scene: Pool(group if scene == "ms" else grouped(group, "scene")[scene]).cell(
            "{0.ms:.1f}" if scene == "ms" else form
        ),
        "ms",
    )


def _ratios(source: str, estimators: dict[str, list[Score]], baseline: str) -> str:
    bases = {scene: Pool(group) for scene, group in grouped(estimators[baseline], "scene").items()}

    def ratio(group: list[Score], scene: str) -> str:
        pool, base = Pool(grouped(group, "scene")[scene]), bases[scene]
        if not (pool.frames and base.frames):
            return "failed"
        shares = f"{base.ms / pool.ms:.1f} / {pool.error / base.error:.2f}"
        return shares + (f" / {pool.mean / base.mean:.2f}" if source == REAL else "")

    shares = "median / mean error" if source == REAL else "error"
    title = f"{source}: times faster than {baseline} / share of its {shares}"
    return _table(title, estimators, ratio)


def _table(
    title: str,
    rows: dict[str, list[Score]],
    cell: Callable[[list[Score], str], str],
    *more_columns: str,
) -> str:
    columns = [*grouped(next(iter(rows.values())), "scene"), *more_columns]
    lines = [[title, *columns]]
    lines += [[name, *(cell(group, column) for column in columns)] for name, group in rows.items()]
    head, *body = ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join([head, "|---" * (len(columns) + 1) + "|", *body])
