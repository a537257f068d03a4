"""What a tracker has to be: two methods on views, in steadied coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ssiam.geometry import XYWH
from ssiam.stabilize import FrameView
from ssiam.track import Track


class ViewTracker(Protocol):
    """A tracker that looks at frames through a `FrameView` and never asks how it was steadied.

    Threads: one thread at a time for each object; those that `another` gives may run at once.

    Boxes go in and come out in the view's steadied coordinates.
    """

    @property
    def doubt(self) -> float | None:
        """Score up to which it is worth while to `seek` in the same frame: 0 where that is costly.

        None for trackers that cannot be told where to look.
        """

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the target in `xywh` as the one to follow, forgetting any other."""

    def track(self, view: FrameView) -> Track:
        """The target in the next view."""

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`, wherever it was before."""

    def another(self) -> ViewTracker:
        """A tracker of the same kind, without a target, that shares what can be shared."""


def pixel_box(xywh: Sequence[float], size_wh: tuple[int, int]) -> tuple[int, int, int, int]:
    """Box rounded to whole pixels and cut to a picture of (width, height), at least one pixel."""
    x, y, w, h = xywh
    width, height = size_wh
    left, top = min(max(round(x), 0), width - 1), min(max(round(y), 0), height - 1)
    right = min(max(round(x) + round(w), left + 1), width)
    bottom = min(max(round(y) + round(h), top + 1), height)
    return left, top, right - left, bottom - top
