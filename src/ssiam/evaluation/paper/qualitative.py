"""`Example`: a tracker alone and stabilized on one sequence; and its boxes in the frames."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.regions import Floats, as_rows, corners_of, is_region, upright
from ssiam.evaluation.measures.trajectory import TrackedSequence
from ssiam.evaluation.paper.canvas import SMALL, canvas, png
from ssiam.evaluation.paper.summary import Summaries, Summary
from ssiam.geometry import Image, iou
from ssiam.stabilize import Method, StabilizerConfig

_MAX_FRAMES: Final = 6
_MIN_GAP: Final = 1 / 15  # between two frames, share of the sequence
_COLUMNS: Final = 3
_CONTEXT: Final = 6.0  # height of a panel, multiples of the target's size
_MIN_HEIGHT: Final = 160.0  # of a panel, px
_ASPECT: Final = 4 / 3  # width / height of a panel
# Name, color and line of each box; the hues are distinguishable with color blindness.
_BOXES: Final = (
    ("truth", "#ffffff", "-"),
    ("off", "#ff9d3c", (0, (3, 1.5))),
    ("stabilized", "#56d4ff", "-"),
)


@dataclass(frozen=True, eq=False)
class Example:
    """Results of a tracker on one sequence, alone and stabilized.

    Attributes
    ----------
    tracker : str
    sequence : VideoSequence
    one_pass : bool
        Whether these are one-pass runs; otherwise the tracker was restarted after each loss.
    truth, off, stabilized : (N, 4) or (N, 8) float64
        Boxes x, y, w, h or corners, pixels; nan in frames without one.
    method : str
        How `stabilized` was stabilized.
    """

    tracker: str
    sequence: VideoSequence
    one_pass: bool
    truth: Floats
    off: Floats
    stabilized: Floats
    method: Method = "paper"

    @property
    def overlaps(self) -> Floats:
        """Overlap (2, N) of off and stabilized upright boxes with the truth; 0 without a box."""
        truth = upright(self.truth)
        regions = self.off, self.stabilized
        return np.nan_to_num([iou(upright(each), truth) for each in regions])

    @property
    def frames(self) -> list[int]:
        """Indices of the frames with the largest differences of overlap, sorted and apart."""
        off, stabilized = self.overlaps
        difference = np.abs(stabilized - off)
        chosen: list[int] = []
        for index in np.argsort(-difference, kind="stable").tolist():
            is_apart = all(abs(index - other) >= _MIN_GAP * len(difference) for other in chosen)
            if is_apart and difference[index] > 0 and len(chosen) < _MAX_FRAMES:
                chosen.append(index)
        return sorted(chosen)


def largest_difference(found: Summaries) -> Example | None:
    """The tracker and sequence with the largest difference between off and stabilized results.

    Ranked by lost targets, then by mean overlap. The example uses one-pass runs if the tracker has
    them both alone and stabilized. None if no tracker was run both ways.
    """
    stabilized = StabilizerConfig("paper")
    pairs = [
        (other, each)
        for each in found.entries
        if each.config == stabilized
        if (other := found.find(each.tracker, StabilizerConfig("off"))) is not None
    ]
    ranked = [
        (
            abs(on.lost[name] - off.lost[name]),
            _change(on.overlaps, off.overlaps, name),
            name,
            off,
            on,
        )
        for off, on in pairs
        for name in off.lost
        if name in on.lost
    ]
    if not ranked:
        return None
    *_, name, off, on = max(ranked, key=lambda each: each[:2])
    return example_of(name, off, on)


def _change(first: Mapping[str, float], second: Mapping[str, float], name: str) -> float:
    change = abs(first[name] - second[name])
    return 0.0 if math.isnan(change) else change


def example_of(name: str, off: Summary, stabilized: Summary) -> Example | None:
    """The results on a sequence; one-pass runs if both have them. None if one has no run."""
    one_pass = name in off.one_pass and name in stabilized.one_pass
    first, second = (each.one_pass if one_pass else each.supervised for each in (off, stabilized))
    if name not in first or name not in second:
        return None
    sequence = first[name].sequence
    count = min(len(each.runs[0]) for each in (first[name], second[name]))
    return Example(
        off.tracker,
        sequence,
        one_pass,
        sequence.truth[:count],
        _regions(first[name], count),
        _regions(second[name], count),
        "paper" if stabilized.config is None else stabilized.config.stabilize,
    )


def _regions(tracked: TrackedSequence, count: int) -> Floats:
    """The regions (N, 8) of the first run; the truth in frames where the tracker was started."""
    run = tracked.runs[0].first(count)
    regions = as_rows(run.regions)
    starts = run.initializations
    regions[starts] = as_rows(tracked.sequence.truth)[starts]
    return regions


def draw_boxes(found: Example) -> bytes:
    """Draw the frames of an example as a PNG.

    Each panel shows the region around the target, and in its title the overlaps with the truth.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    SourceError
        A frame cannot be read.
    """
    frames = found.frames
    columns = min(_COLUMNS, len(frames))
    rows = -(-len(frames) // columns)
    figure, panels = canvas((3.4 * columns, 2.85 * rows + 0.4), (rows, columns))
    for panel in panels.flat:
        panel.set_axis_off()
    for panel, index in zip(panels.flat, frames, strict=False):
        boxes = found.truth[index], found.off[index], found.stabilized[index]
        _draw(panel, next(found.sequence.images(index)), boxes)
        off, stabilized = found.overlaps[:, index]
        panel.set_title(
            f"frame {index}: off {off:.2f}, stabilized {stabilized:.2f}", fontsize=SMALL
        )
    _legend(figure)
    return png(figure)


def _draw(panel: Any, image: Image, boxes: tuple[Floats, ...]) -> None:
    left, top, right, bottom = _panel_bounds(image, upright(boxes[0][None])[0])
    extent = (left - 0.5, right - 0.5, bottom - 0.5, top - 0.5)
    panel.imshow(image[top:bottom, left:right, ::-1], extent=extent)
    for region, (_, color, line) in zip(boxes, _BOXES, strict=True):
        outline_region(panel, region, color, line)
    panel.set(xlim=extent[:2], ylim=extent[2:])


def outline_region(
    panel: Any, region: Floats, color: str, line: Any = "-", width: float = 1.8
) -> None:
    """Draw a box (4,) or corners (8,), pixels, in lines of `width` points; nothing if it is nan."""
    from matplotlib.patches import Polygon
    from matplotlib.patheffects import Normal, Stroke

    rows = as_rows(region[None])
    if is_region(rows)[0]:
        outline = Polygon(corners_of(rows)[0], fill=False, ec=color, lw=width, ls=line)
        outline.set_path_effects([Stroke(linewidth=width + 1.4, foreground="#000000a0"), Normal()])
        panel.add_patch(outline)


def _panel_bounds(image: Image, xywh: Floats) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the region around a box; the whole frame without one."""
    height, width = image.shape[:2]
    x, y, w, h = xywh
    if not np.isfinite(xywh).all():
        return 0, 0, width, height
    span_h = min(max(_CONTEXT * max(w / _ASPECT, h), _MIN_HEIGHT), height, width / _ASPECT)
    span_w = span_h * _ASPECT
    left = round(float(np.clip(x + w / 2 - span_w / 2, 0, width - span_w)))
    top = round(float(np.clip(y + h / 2 - span_h / 2, 0, height - span_h)))
    return left, top, left + int(span_w), top + int(span_h)


def _legend(figure: Any) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=color, ls=line, lw=2) for _, color, line in _BOXES]
    names = [name for name, *_ in _BOXES]
    figure.legend(
        handles,
        names,
        loc="outside lower center",
        ncols=len(names),
        fontsize=SMALL,
        facecolor="#404040",
        labelcolor="white",
    )
