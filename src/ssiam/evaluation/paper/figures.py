"""Figures of the paper: 3 (camera path), 4 (example frames, see `qualitative`) and 6 (ranking)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.errors import MissingExtraError, one_line
from ssiam.evaluation.measures.eao import INTERVALS
from ssiam.evaluation.measures.regions import Floats
from ssiam.evaluation.measures.success import THRESHOLDS, mean_success
from ssiam.evaluation.measures.vot_toolkit import ar_point, scores
from ssiam.evaluation.paper.canvas import (
    BLUE,
    COLORS,
    GRAY,
    ORANGE,
    SMALL,
    NothingToDrawError,
    canvas,
    png,
    style_axes,
)
from ssiam.evaluation.paper.qualitative import figure4, largest_difference
from ssiam.evaluation.paper.summary import Summaries, Summary, success_of
from ssiam.motion import CameraMotion
from ssiam.stabilize import METHODS, CameraPath, StabilizerConfig

_RUN_NOTES: Final = {  # by `Example.one_pass`
    True: "One pass, no restarts.",
    False: "Restarted five frames after each loss; no box in between.",
}
_AXES: Final = (
    ("dx", "px, right", 1.0),
    ("dy", "px, down", 1.0),
    ("da", "degrees, clockwise", 180 / np.pi),
)
# By stabilization method; results of other programs are drawn as "off".
_LINES: Final = {"off": "--", "paper": "-", "literal": ":", "predict": "-."}
_MARKERS: Final = {"off": "o", "paper": "s", "literal": "^", "predict": "D"}
_DEFAULTS: Final = (None, *(StabilizerConfig(method) for method in METHODS))


@dataclass(frozen=True)
class Figure:
    """A figure of the page that `write_page` makes.

    Attributes
    ----------
    name : str
        File name without suffix.
    title, caption : str
    png : bytes
    """

    name: str
    title: str
    caption: str
    png: bytes


def figures(found: Summaries) -> tuple[list[Figure], list[str]]:
    """Draw figures 3, 4 and 6; figures 3 and 4 of the sequence that stabilization changes most.

    Returns
    -------
    figures : list of Figure
    notes : list of str
        A line for each figure that cannot be drawn.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    drawn: list[Figure] = []
    notes: list[str] = []
    for number, draw in ((3, _figure3), (4, _figure4), (6, _figure6)):
        try:
            drawn.append(draw(found))
        except MissingExtraError:
            raise
        except Exception as error:
            notes.append(f"{found.dataset}: no figure {number}: {one_line(error)}")
    return drawn, notes


def _figure3(found: Summaries) -> Figure:
    example = largest_difference(found)
    sequence = next(iter(found.sequences.values())) if example is None else example.sequence
    return Figure(
        f"fig3-{found.dataset}",
        f"Fig. 3: the camera's path in {sequence.name}",
        "Motion at the image center, summed over the frames, and its mean over the last 30 frames. "
        "Gray: frames with unreliable motion.",
        _figure3_png(sequence, StabilizerConfig("paper")),
    )


def _figure4(found: Summaries) -> Figure:
    example = largest_difference(found)
    if example is None or not example.frames:
        raise NothingToDrawError("no sequence has both off and paper results with different boxes")
    return Figure(
        f"fig4-{found.dataset}",
        f"Fig. 4: {example.tracker} on {example.sequence.name}, alone and stabilized",
        "The frames with the largest difference of overlap, on the sequence with the largest "
        f"difference. {_RUN_NOTES[example.one_pass]}",
        figure4(example),
    )


def _figure6(found: Summaries) -> Figure:
    plot = "success" if found.year is None else "accuracy and robustness"
    return Figure(
        f"fig6-{found.dataset}",
        f"Fig. 6: {plot} on {found.dataset}",
        "Dashed or hollow: the tracker alone. Solid or filled: stabilized.",
        _figure6_png(found),
    )


def _figure3_png(sequence: VideoSequence, config: StabilizerConfig) -> bytes:
    """The camera path (dx, dy, da) over the frames of a sequence, raw and smoothed."""
    path, smooth, reliable = camera_path(sequence, config)
    figure, panels = canvas((9, 6.4), (3, 1), sharex=True)
    for column, (panel, (name, unit, factor)) in enumerate(zip(panels.flat, _AXES, strict=True)):
        for frame in np.flatnonzero(~reliable):
            panel.axvspan(frame - 0.5, frame + 0.5, color=GRAY, lw=0, zorder=0)
        panel.plot(factor * path[:, column], color=ORANGE, lw=1.1, label="camera path")
        panel.plot(factor * smooth[:, column], color=BLUE, lw=1.7, label="smoothed path")
        panel.set_ylabel(f"{name}  ({unit})")
        style_axes(panel)
    figure.align_ylabels()
    panels[0, 0].legend(loc="best", frameon=False, fontsize=SMALL)
    panels[-1, 0].set_xlabel("frame")
    return png(figure)


def camera_path(
    sequence: VideoSequence, config: StabilizerConfig
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The camera path of a sequence with ground truth, raw and smoothed.

    The true box is excluded from the motion estimate. Both paths stay constant in frames with
    unreliable motion.

    Returns
    -------
    path, smooth : (N, 3) float64
        dx and dy in pixels at the image center and da in radians, summed from the first frame on.
    reliable : (N,) bool

    Raises
    ------
    SourceError
        A frame cannot be read.
    """
    camera = CameraMotion(config.keypoints, config.fit, model="rigid")
    recent_path = CameraPath(config.paper.window)
    steps, differences, reliable = [], [], []
    for index, image in enumerate(sequence.images()):
        motion = camera.update(image, exclude=_target(sequence, index - 1))
        is_reliable = motion.reliable or index == 0
        if is_reliable:
            recent_path.advance(motion)
        steps.append(motion.shift_angle if is_reliable else (0.0, 0.0, 0.0))
        differences.append(recent_path.difference())
        reliable.append(is_reliable)
    path = np.cumsum(steps, axis=0)
    return path, path + np.array(differences), np.array(reliable)


def _target(sequence: VideoSequence, index: int) -> tuple[float, ...] | None:
    """The true box in a frame; None if there is none."""
    known = 0 <= index < len(sequence.truth) and np.isfinite(sequence.truth[index]).all()
    return sequence.box(index) if known else None


def _figure6_png(found: Summaries) -> bytes:
    """Ranking of all trackers with default settings; one color per tracker.

    On a year of VOT: the AR plot by vot-toolkit's conventions, where up and right are better. On
    other datasets: the success plot of one-pass runs, or of supervised runs if an entry lacks them.
    """
    chosen = [each for each in found.entries if each.config in _DEFAULTS]
    if found.year is not None:
        chosen = [each for each in chosen if each.scores is not None]
    if not chosen:
        raise NothingToDrawError("no tracker has results to rank")
    figure, panels = canvas((8, 4.6), (1, 1))
    panel = panels[0, 0]
    if found.year is None:
        _draw_success(panel, chosen)
    else:
        _draw_ar(panel, chosen, found.year)
    style_axes(panel)
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
        style = {"marker": _MARKERS[method], "ec": color, "fc": face}
        panel.scatter([x], [y], s=70, lw=1.8, label=each.label, **style)
    panel.set(xlabel="robustness: share of targets still tracked after 30 frames")
    panel.set(ylabel="accuracy: mean overlap")


def _colors(chosen: Sequence[Summary]) -> list[str]:
    trackers = list(dict.fromkeys(each.tracker for each in chosen))
    return [COLORS[trackers.index(each.tracker) % len(COLORS)] for each in chosen]


def _method(summary: Summary) -> str:
    return "off" if summary.config is None else summary.config.stabilize
