"""`ViewTracker`: the interface of a tracker that runs on stabilized views."""

from __future__ import annotations

from typing import Protocol

from ssiam.geometry import XYWH
from ssiam.stabilize import FrameView
from ssiam.track import Track


class ViewTracker(Protocol):
    """A single-target tracker whose input is a `FrameView`.

    Threads: one thread at a time for each object; an object and its clones may run at once.

    All boxes are in the view's stabilized pixels: a tracker does not know how its frames are
    stabilized.
    """

    @property
    def can_seek(self) -> bool:
        """Whether the tracker can search around a given box.

        If not, `seek` is not called, and a lost target is not searched for.
        """

    @property
    def reseek_below(self) -> float:
        """Score (0..1) up to which a second search in the same frame is worth its cost."""

    @property
    def center_inset(self) -> float:
        """The center of a first box is at ``x + (w - center_inset) / 2``, pixels.

        A rotated box is turned into the upright box whose center, so defined, is its own.
        """

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the object in `xywh` as the target; an earlier target is dropped."""

    def track(self, view: FrameView) -> Track:
        """The target in the next view, searched around its last box."""

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`."""

    def clone(self) -> ViewTracker:
        """A tracker of the same kind without a target, which shares the networks."""
