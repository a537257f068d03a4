"""Markdown tables and their cells."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np


def line(cells: Iterable[object]) -> str:
    """A line of a Markdown table."""
    return "| " + " | ".join(map(str, cells)) + " |"


def head(cells: Sequence[object]) -> str:
    """The first two lines of a Markdown table."""
    return f"{line(cells)}\n{'|---' * len(cells)}|"


def spread(values: Sequence[float], form: str) -> str:
    """The mean of the values, and their minimum and maximum if there are several."""
    mean = form.format(round(float(np.mean(values)), 3))
    if len(values) == 1:
        return mean
    return f"{mean} ({form.format(min(values))} to {form.format(max(values))})"
