"""The interface of a tracker on views.

A tracker is any class with the two methods of `ViewTracker`. Everything else is optional, and is
declared by being there:

===================== ======================================================== ==================
member                meaning                                                  without it
===================== ======================================================== ==================
`seek`                the target in a view, searched around a given box        no search when lost
`clone`               another one without a target, on the same networks       the class is called
`reseek_below`        score up to which a second search in a frame pays        0
`center_inset`        center of a first box: ``x + (w - center_inset) / 2``    0
`can_seek`            whether `seek` is used                                   if there is a `seek`
`template_feature`    the network's features of the template, one vector       pixels
`score_is_calibrated` whether the score is a probability, as `Track` says      False
===================== ======================================================== ==================

Masks and rotated boxes are in the tracks. `ssiam.trackers.foreign` completes and checks trackers of
other classes; `ssiam.testing` has checks for them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.geometry import XYWH
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.responses import Response

if TYPE_CHECKING:
    from ssiam.trackers.box_mask import BoxMask  # imports this module

Floats = NDArray[np.float64]


class ViewTracker(Protocol):
    """A single-target tracker whose input is a `FrameView`: all that a tracker must have.

    Threads: one thread at a time for each object; an object and its clones may run at once.

    All boxes are in the view's stabilized pixels: a tracker does not know how its frames are
    stabilized.
    """

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the object in `xywh` as the target; an earlier target is dropped."""

    def update(self, view: FrameView) -> Track:
        """The target in the next view, searched around its last box."""


class CompleteTracker(DeepCopied, ABC):
    """A tracker with everything that `StabilizedTracker` uses; base of the package's own.

    Threads: one thread at a time for each object; an object and its clones may run at once.
    """

    @property
    def name(self) -> str:
        """The tracker's class, for messages."""
        return type(self).__name__

    @property
    def can_seek(self) -> bool:
        """Whether the tracker can search around a given box.

        If not, `seek` is not called, and a lost target is not searched for.
        """
        return True

    @property
    def reseek_below(self) -> float:
        """Score (0..1) up to which a second search in the same frame is worth its cost."""
        return 0.0

    @property
    def center_inset(self) -> float:
        """The center of a first box is at ``x + (w - center_inset) / 2``, pixels.

        A rotated box is turned into the upright box whose center, so defined, is its own.
        """
        return 1.0

    @property
    def score_is_calibrated(self) -> bool:
        """Whether the score is the probability that the IoU of the box exceeds 0.5."""
        return True

    @property
    def has_template_feature(self) -> bool:
        """Whether `template_feature` gives features of a network."""
        return False

    @property
    def has_responses(self) -> bool:
        """Whether `respond`, `accept` and `move_to` are available."""
        return False

    @property
    def box_mask(self) -> BoxMask | None:
        """The network for the mask of the object in a box, if the tracker has one."""
        return None

    @property
    def prefers_prediction(self) -> bool:
        """Whether candidates near the predicted position are ranked higher."""
        return self.has_responses

    @property
    def runs_networks(self) -> bool:
        """Whether `update` takes most of its time in networks of `ssiam.runtime`."""
        return False

    @abstractmethod
    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the object in `xywh` as the target; an earlier target is dropped."""

    @abstractmethod
    def update(self, view: FrameView) -> Track:
        """The target in the next view, searched around its last box."""

    @abstractmethod
    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`."""

    @abstractmethod
    def clone(self) -> CompleteTracker:
        """A tracker of the same kind without a target, which shares the networks."""

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64; the tracker has a target."""
        raise NotImplementedError

    def respond(self, view: FrameView) -> Response:
        """The candidates in the next view, searched around the last box; nothing is changed."""
        raise NotImplementedError

    def accept(self, view: FrameView, response: Response, index: int) -> Track:
        """Take a candidate of `respond` as the target; with its `best`, the result of `update`."""
        raise NotImplementedError

    def move_to(self, xywh: XYWH) -> None:
        """Search around `xywh`, the view's pixels, from now on."""
        raise NotImplementedError
