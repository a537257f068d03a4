"""Fig. 1 and 6 of the paper: rows of frames, one for each sequence, with the boxes in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ssiam.evaluation.measures.regions import upright
from ssiam.evaluation.paper.canvas import SMALL, NothingToDrawError, canvas, png
from ssiam.evaluation.paper.published import ABLATION_TRACKER, PAPER_TRACKERS
from ssiam.evaluation.paper.qualitative import Example, example_of, outline_region
from ssiam.evaluation.paper.summary import Summaries, Summary
from ssiam.stabilize import Method, StabilizerConfig

# The sequences of the paper's Fig. 6.
PAPER_SEQUENCES: Final = ("soccer2", "wiper", "helicopter", "blanket")

# Stabilization methods that a strip shows, the preferred one first.
_STABILIZED: Final[tuple[Method, ...]] = ("paper", "predict")
_MAX_ROWS: Final = {"failures": 3, "results": 4}
_OUTPUTS: Final = 4  # frames after the first one in a row
_MIN_GAP: Final = 1 / 15  # between two of them, share of the sequence
_PANEL_WIDTH: Final = 2.6  # inches
_TRUTH_WIDTH: Final = 3.6  # points; visible around a box that covers the truth
# The colors of the paper's boxes.
_YELLOW, _BLUE, _GREEN = "#ffe11a", "#3c8cff", "#1ee65a"


@dataclass(frozen=True)
class Strip:
    """A row: an example, and the indices of its frames, the first frame first."""

    example: Example
    frames: tuple[int, ...]


def examples(found: Summaries, names: Sequence[str] = ()) -> list[Example]:
    """A tracker alone and stabilized on some sequences, the ones to show first.

    The tracker is the paper's (SiamMask_E) if it was run both ways, else the one that gains most.

    Parameters
    ----------
    found : Summaries
    names : sequence of str
        Sequences to show. By default those of the paper's Fig. 6 that are there; else all, those
        with the largest gain of mean overlap first.

    Raises
    ------
    NothingToDrawError
        No tracker has results alone and stabilized, of these sequences.
    """
    by_pair = [
        [each for name in names or found.sequences if (each := example_of(name, *pair))]
        for pair in _pairs(found)
    ]
    by_pair = [each for each in by_pair if each]
    if not by_pair:
        of_what = f" of {', '.join(names)}" if names else ""
        raise NothingToDrawError(f"no tracker has both off and paper or predict results{of_what}")
    preferred = PAPER_TRACKERS[ABLATION_TRACKER]
    chosen = max(
        by_pair,
        key=lambda shown: (shown[0].tracker == preferred, sum(map(gain, shown))),
    )
    paper = [each for name in PAPER_SEQUENCES for each in chosen if each.sequence.name == name]
    if names:
        return chosen
    return paper or sorted(chosen, key=gain, reverse=True)


def gain(example: Example) -> float:
    """Mean overlap stabilized minus alone."""
    off, stabilized = example.overlaps
    return float((stabilized - off).mean())


def failures(shown: Iterable[Example], *, limit: bool = True) -> list[Strip]:
    """The first frame and the frames up to a loss of the tracker alone (Fig. 1).

    Raises
    ------
    NothingToDrawError
        The tracker alone lost no target.
    """
    strips = []
    for each in shown:
        known = np.isfinite(each.truth).all(axis=1)
        misses = np.flatnonzero(known & (each.overlaps[0] == 0))
        loss = next((int(index) for index in misses if index >= _OUTPUTS), None)
        if loss is not None:
            strips.append(Strip(each, (0, *range(loss - _OUTPUTS + 1, loss + 1))))
    if not strips:
        raise NothingToDrawError("the tracker alone lost no target")
    return strips[: _MAX_ROWS["failures"]] if limit else strips


def results(shown: Iterable[Example], *, limit: bool = True) -> list[Strip]:
    """The first frame and those in which stabilization gains most (Fig. 6)."""
    strips = [Strip(each, (0, *_best_frames(each))) for each in shown]
    return strips[: _MAX_ROWS["results"]] if limit else strips


def draw_strips(strips: Sequence[Strip], *, stabilized: bool) -> bytes:
    """Draw a row of frames for each sequence, as a PNG.

    The tracker alone is yellow, the truth green and the stabilized tracker blue. Without the
    latter, a dashed line marks the same height in each frame after the first: where the target is
    in the second.

    Parameters
    ----------
    strips : sequence of Strip
    stabilized : bool
        Whether to draw the stabilized tracker's boxes.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    SourceError
        A frame cannot be read.
    """
    rows = [[next(each.example.sequence.images(index)) for index in each.frames] for each in strips]
    ratios = [images[0].shape[0] / images[0].shape[1] for images in rows]
    columns = max(map(len, rows))
    size = (_PANEL_WIDTH * columns + 0.3, _PANEL_WIDTH * sum(ratios) + 0.7)
    figure, panels = canvas(size, (len(rows), columns), gridspec_kw={"height_ratios": ratios})
    for panel in panels.flat:
        panel.set(xticks=[], yticks=[])
        panel.spines[:].set_visible(False)
    for strip, images, line_of_panels in zip(strips, rows, panels, strict=True):
        example = strip.example
        line_of_panels[0].set_ylabel(example.sequence.name, fontsize=SMALL + 2)
        _, top, _, h = upright(example.truth[strip.frames[1]][None])[0]
        for index, image, panel in zip(strip.frames, images, line_of_panels, strict=False):
            panel.imshow(image[..., ::-1])
            _label(panel, f"frame {index}", "white", 0.02)
            outline_region(panel, example.truth[index], _GREEN, width=_TRUTH_WIDTH)
            shown = [("off", example.off[index], _YELLOW)]
            if stabilized:
                shown.append((example.method, example.stabilized[index], _BLUE))
            for order, (name, region, color) in enumerate(shown if index else ()):
                outline_region(panel, region, color)
                if not np.isfinite(region[:4]).all():
                    _label(panel, f"{name}: lost", color, 0.98, -order)
            if not stabilized and index:
                panel.axhline(top + h / 2, color=_GREEN, ls=(0, (4, 3)), lw=1)
            panel.set(xlim=(-0.5, image.shape[1] - 0.5), ylim=(image.shape[0] - 0.5, -0.5))
    panels[0, 0].set_title("first frame", fontsize=SMALL + 2)
    panels[0, columns // 2].set_title(
        "output" if stabilized else "the frames up to the loss", fontsize=SMALL + 2
    )
    _legend(figure, strips[0].example, stabilized)
    return png(figure)


def _pairs(found: Summaries) -> list[tuple[Summary, Summary]]:
    """Of each tracker the results alone and stabilized, by the preferred method that was run."""
    pairs = []
    for tracker in dict.fromkeys(each.tracker for each in found.entries):
        off = found.find(tracker, StabilizerConfig("off"))
        methods = (found.find(tracker, StabilizerConfig(method)) for method in _STABILIZED)
        stabilized = next((each for each in methods if each is not None), None)
        if off is not None and stabilized is not None:
            pairs.append((off, stabilized))
    return pairs


def _best_frames(example: Example) -> list[int]:
    """Indices of frames with the largest gain of overlap, sorted, apart from each other.

    Without enough frames with a gain, frames over the whole sequence fill the row.
    """
    off, stabilized = example.overlaps
    count = len(off)
    gains = stabilized - off
    best = [index for index in np.argsort(-gains, kind="stable") if gains[index] > 0]
    spread = np.linspace(count - 1, 0, 2 * _OUTPUTS, endpoint=False).astype(int)
    chosen: list[int] = []
    for index in (*best, *spread):
        is_apart = all(abs(index - other) >= _MIN_GAP * count for other in (0, *chosen))
        if is_apart and len(chosen) < _OUTPUTS:
            chosen.append(int(index))
    return sorted(chosen)


def _label(panel: Any, text: str, color: str, x: float, line: int = 0) -> None:
    """Write text into the upper corner of a panel: left for a small x, right for a large one."""
    panel.text(
        x,
        0.97 + 0.13 * line,
        text,
        color=color,
        fontsize=SMALL - 1,
        transform=panel.transAxes,
        ha="left" if x < 0.5 else "right",
        va="top",
        bbox={"fc": "#000000a0", "ec": "none", "pad": 1.5},
    )


def _legend(figure: Any, example: Example, stabilized: bool) -> None:
    from matplotlib.lines import Line2D

    shown = [(f"{example.tracker} alone", _YELLOW), ("truth", _GREEN)]
    if stabilized:
        shown.insert(1, (f"{example.tracker} stabilized ({example.method})", _BLUE))
    figure.legend(
        [Line2D([], [], color=color, lw=2.5) for _, color in shown],
        [name for name, _ in shown],
        loc="outside lower center",
        ncols=len(shown),
        fontsize=SMALL,
        facecolor="#404040",
        labelcolor="white",
    )
