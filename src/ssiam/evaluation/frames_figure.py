"""Fig. 4 of the paper, read as: frames with the boxes of a tracker alone and steadied."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ssiam.evaluation.canvas import SMALL, canvas, png
from ssiam.evaluation.differing import Differing
from ssiam.evaluation.raster import Floats
from ssiam.geometry import Image

_COLUMNS: Final = 3
# A target is shown in surroundings of so many times its size, and of so many pixels at least.
_SURROUNDINGS, _LEAST = 6.0, 160.0
_SHAPE: Final = 4 / 3  # width by height
# Name, colour and line of each box; the hues are told apart by the colour-blind.
_BOXES: Final = (
    ("truth", "#ffffff", "-"),
    ("off", "#ff9d3c", (0, (3, 1.5))),
    ("steadied", "#56d4ff", "-"),
)


def figure4(found: Differing) -> bytes:
    """The frames in which a tracker alone and steadied differ most, as a PNG.

    Each shows the target's surroundings, and above it the overlap of both with the truth.

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
        boxes = found.truth[index], found.off[index], found.steadied[index]
        _draw(panel, next(found.sequence.images(index)), boxes)
        off, steadied = found.overlaps[:, index]
        panel.set_title(f"frame {index}: off {off:.2f}, steadied {steadied:.2f}", fontsize=SMALL)
    _legend(figure)
    return png(figure)


def _draw(panel: Any, image: Image, boxes: tuple[Floats, ...]) -> None:
    from matplotlib.patches import Rectangle
    from matplotlib.patheffects import Normal, Stroke

    left, top, right, bottom = _window(image, boxes[0])
    extent = (left - 0.5, right - 0.5, bottom - 0.5, top - 0.5)
    panel.imshow(image[top:bottom, left:right, ::-1], extent=extent)
    for (x, y, w, h), (_, color, line) in zip(boxes, _BOXES, strict=True):
        if np.isfinite((x, y, w, h)).all():
            outline = Rectangle((x, y), w, h, fill=False, ec=color, lw=1.8, ls=line)
            outline.set_path_effects([Stroke(linewidth=3.2, foreground="#000000a0"), Normal()])
            panel.add_patch(outline)
    panel.set(xlim=extent[:2], ylim=extent[2:])


def _window(image: Image, xywh: Floats) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the target's surroundings; the whole frame without a target."""
    height, width = image.shape[:2]
    x, y, w, h = xywh
    if not np.isfinite(xywh).all():
        return 0, 0, width, height
    span_h = min(max(_SURROUNDINGS * max(w / _SHAPE, h), _LEAST), height, width / _SHAPE)
    span_w = span_h * _SHAPE
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
