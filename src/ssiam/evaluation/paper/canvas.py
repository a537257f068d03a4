"""Shared by the figures: an off-screen matplotlib figure, colors, axes style, PNG output."""

from __future__ import annotations

import importlib.util
import io
from typing import Any, Final

from ssiam.errors import MissingExtraError, SsiamError

# Colors of Okabe and Ito, distinguishable with color blindness.
BLUE: Final = "#0072b2"
ORANGE: Final = "#d55e00"
GREEN: Final = "#009e73"
COLORS: Final = (BLUE, "#e69f00", GREEN, "#cc79a7", "#56b4e9", ORANGE, "#000000")
GRAY: Final = "#d9d9d9"
SMALL: Final = 9  # points, of legends and captions

_DPI: Final = 130


class NothingToDrawError(SsiamError):
    """The results contain no data for a figure."""


def check_matplotlib() -> None:
    """Raise `MissingExtraError` unless matplotlib is installed."""
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("figures need matplotlib: pip install 'ssiam[bench]'")


def canvas(size: tuple[float, float], grid: tuple[int, int], **options: Any) -> tuple[Any, Any]:
    """A matplotlib figure of `size` inches, and its axes in an array of `grid` rows and columns."""
    check_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(*grid, squeeze=False, **options)


def style_axes(axes: Any) -> None:
    """Add a light grid, and remove the top and right spines."""
    axes.set_axisbelow(True)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def png(figure: Any) -> bytes:
    """Render the figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI)
    return buffer.getvalue()
