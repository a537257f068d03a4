"""Scores of camera-motion estimators, and their Markdown tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.motion.clips import REAL

FAR = 1.0  # % of the width, beyond which an estimate is useless


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


def grouped(scores: Iterable[Score], attribute: str) -> dict[str, list[Score]]:
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
    for place, here in grouped(scores, "place").items():
        estimators = grouped(here, "estimator")
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
                parts.append(_figures(title, grouped(estimators[name], "clip"), form))
    return "\n\n".join(parts)


def _figures(title: str, rows: dict[str, list[Score]], form: str) -> str:
    """A row for each group of scores, a column for each scene, and the time."""
    return _table(
        title,
        rows,
        lambda group, scene: Pool(group if scene == "ms" else grouped(group, "scene")[scene]).show(
            "{0.ms:.1f}" if scene == "ms" else form
        ),
        "ms",
    )


def _ratios(place: str, estimators: dict[str, list[Score]], baseline: str) -> str:
    bases = {scene: Pool(group) for scene, group in grouped(estimators[baseline], "scene").items()}

    def ratio(group: list[Score], scene: str) -> str:
        pool, base = Pool(grouped(group, "scene")[scene]), bases[scene]
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
    columns = [*grouped(next(iter(rows.values())), "scene"), *more_columns]
    lines = [[title, *columns]]
    lines += [[name, *(cell(group, column) for column in columns)] for name, group in rows.items()]
    head, *body = ["| " + " | ".join(line) + " |" for line in lines]
    return "\n".join([head, "|---" * (len(columns) + 1) + "|", *body])
