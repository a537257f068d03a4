"""`ForeignTracker`: a tracker of any class, completed and checked."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from ssiam.errors import ArgumentError, CopyError, FrameSizeError, TrackingError, one_line
from ssiam.geometry import XYWH, finite_array, short_repr
from ssiam.stabilize import FrameView
from ssiam.track import Outline, PendingOutline, Track
from ssiam.trackers.base import CompleteTracker, Floats, ViewTracker


def complete(
    tracker: ViewTracker, make: Callable[[], ViewTracker] | None = None
) -> CompleteTracker:
    """The tracker itself if it is complete, else a `ForeignTracker` around it.

    Parameters
    ----------
    tracker : ViewTracker
    make : callable, optional
        Makes another tracker of the same kind. By default its class is called without arguments.

    Raises
    ------
    ArgumentError
        It is a class, or has no `init` or no `update`.
    """
    if isinstance(tracker, CompleteTracker):
        return tracker
    if isinstance(tracker, type):
        raise ArgumentError(f"tracker is the class {tracker.__name__}: give {tracker.__name__}()")
    missing = [name for name in ("init", "update") if not callable(getattr(tracker, name, None))]
    if missing:
        raise ArgumentError(
            f"{type(tracker).__name__} is not a tracker: it has no {missing[0]}; a tracker has "
            "init(view, xywh) and update(view)"
        )
    return ForeignTracker(tracker, make)


class ForeignTracker(CompleteTracker):
    """A tracker of any class, completed, whose exceptions and results are checked.

    Threads: as the tracker's own class.

    What the tracker raises is reported as one `TrackingError` (or `ArgumentError`, if it raises
    one) that names its class. So is a result that is not a `Track`, or whose numbers cannot be.

    Parameters
    ----------
    tracker : ViewTracker
    make : callable, optional
        Makes another tracker of the same kind; used if it has no `clone`.
    """

    def __init__(self, tracker: ViewTracker, make: Callable[[], ViewTracker] | None = None) -> None:
        self.tracker: Any = tracker
        self._make = make

    def __deepcopy__(self, memo: dict[int, Any]) -> ForeignTracker:
        try:
            return ForeignTracker(copy.deepcopy(self.tracker, memo), self._make)
        except Exception as error:
            raise CopyError(f"{self.name} cannot be copied: {one_line(error)}") from error

    @property
    def name(self) -> str:
        """The class of the tracker, for messages."""
        return type(self.tracker).__name__

    @property
    def can_seek(self) -> bool:
        """As declared; by default, whether the tracker has a method `seek`."""
        return bool(getattr(self.tracker, "can_seek", hasattr(self.tracker, "seek")))

    @property
    def reseek_below(self) -> float:
        """As declared; by default 0."""
        return self._number("reseek_below")

    @property
    def center_inset(self) -> float:
        """As declared; by default 0."""
        return self._number("center_inset")

    @property
    def score_is_calibrated(self) -> bool:
        """As declared; by default False."""
        return bool(getattr(self.tracker, "score_is_calibrated", False))

    @property
    def has_template_feature(self) -> bool:
        """As declared; by default, whether the tracker has a method `template_feature`."""
        has_method = hasattr(self.tracker, "template_feature")
        return bool(getattr(self.tracker, "has_template_feature", has_method))

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the object in `xywh` as the target; an earlier target is dropped."""
        with self._named("init"):
            self.tracker.init(view, xywh)

    def update(self, view: FrameView) -> Track:
        """The target in the next view, searched around its last box."""
        with self._named("update"):
            track = self.tracker.update(view)
        return self._checked("update", track, view)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, searched around `xywh`."""
        with self._named("seek"):
            track = self.tracker.seek(view, xywh)
        return self._checked("seek", track, view)

    def clone(self) -> CompleteTracker:
        """A tracker of the same kind without a target.

        Raises
        ------
        ArgumentError
            The class has no `clone` and cannot be called without arguments.
        """
        if hasattr(self.tracker, "clone"):
            with self._named("clone"):
                cloned = self.tracker.clone()
        else:
            try:
                cloned = (self._make or type(self.tracker))()
            except Exception as error:
                raise ArgumentError(
                    f"a second {self.name} cannot be made: it has no clone(), and {self.name}() "
                    f"failed ({one_line(error)}); give it a method clone()"
                ) from error
        completed = complete(cloned, self._make)
        if isinstance(completed, ForeignTracker) and completed.tracker is self.tracker:
            raise TrackingError(f"{self.name}.clone returned the tracker itself: return a new one")
        return completed

    def template_feature(self) -> Floats:
        """The network's features of the template, (n,) float64."""
        with self._named("template_feature"):
            feature = finite_array(self.tracker.template_feature())
        if feature is None or not feature.size:
            raise TrackingError(
                f"{self.name}.template_feature returned no finite numbers: return a vector"
            )
        return feature.ravel()

    @contextmanager
    def _named(self, method: str) -> Iterator[None]:
        """Report what the tracker raises as an error that names its class."""
        try:
            yield
        except FrameSizeError:  # of the caller's frame, and an error of all targets
            raise
        except Exception as error:
            kind = ArgumentError if isinstance(error, ArgumentError) else TrackingError
            raise kind(f"{self.name}.{method} failed: {one_line(error)}") from error

    def _number(self, name: str) -> float:
        value = finite_array(getattr(self.tracker, name, 0.0))
        if value is None or value.shape != ():
            raise ArgumentError(
                f"{self.name}.{name} is {short_repr(getattr(self.tracker, name))}: give a number"
            )
        return float(value)

    def _checked(self, method: str, track: Any, view: FrameView) -> Track:
        """The track with plain floats; `TrackingError` if it is not one."""
        returned = f"{self.name}.{method} returned"
        if not isinstance(track, Track):
            raise TrackingError(
                f"{returned} {short_repr(track)}: return ssiam.Track(box, score=score)"
            )
        box, score = finite_array(track.box), finite_array(track.score)
        if box is None or box.shape != (4,) or not (box[2:] > 0).all():
            raise TrackingError(
                f"{returned} the box {short_repr(track.box)}: return x, y, width, height, finite, "
                "and width and height above 0"
            )
        if score is None or score.shape != () or not 0 <= score <= 1:
            raise TrackingError(f"{returned} the score {short_repr(track.score)}: return 0 to 1")
        x, y, w, h = box.tolist()
        changes: dict[str, Any] = {"box": (x, y, w, h), "score": float(score)}
        pending = track.__dict__["mask"]
        if isinstance(pending, PendingOutline):
            compute = partial(self._computed_outline, method, pending, view.size_wh)
            changes["mask"] = PendingOutline(compute)
            if track.__dict__["corners"] is pending:
                changes["corners"] = changes["mask"]
        else:
            self._check_outline(method, Outline(track.corners, track.mask), view.size_wh)
        return track.with_changes(**changes)

    def _computed_outline(
        self, method: str, pending: PendingOutline, size_wh: tuple[int, int]
    ) -> Outline:
        with self._named(method):
            outline = pending.read()
        self._check_outline(method, outline, size_wh)
        return outline

    def _check_outline(self, method: str, outline: Outline, size_wh: tuple[int, int]) -> None:
        width, height = size_wh
        mask: Any = outline.mask
        if mask is not None and not (
            isinstance(mask, np.ndarray)
            and mask.dtype == np.bool_
            and mask.shape == (height, width)
        ):
            form = f"{getattr(mask, 'dtype', type(mask).__name__)} {getattr(mask, 'shape', '')}"
            raise TrackingError(
                f"{self.name}.{method} returned a mask of {form.strip()}: return bool "
                f"({height}, {width})"
            )
        if outline.corners is not None:
            corners = finite_array(outline.corners)
            if corners is None or corners.shape != (4, 2):
                raise TrackingError(
                    f"{self.name}.{method} returned the corners {short_repr(outline.corners)}: "
                    "return four points (4, 2), finite"
                )
