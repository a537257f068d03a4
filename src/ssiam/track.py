"""`Track`: the result of a tracker for one frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Any, Generic, Literal, NamedTuple, TypeAlias, TypeVar, cast, overload

import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Points, Transform, map_box, map_mask, map_points
from ssiam.motion import Motion

Mask: TypeAlias = NDArray[np.bool_]
ValueT = TypeVar("ValueT")


class Outline(NamedTuple):
    """The target's rotated box and its pixels.

    Attributes
    ----------
    corners : (4, 2) float64 or None
        Corners of the rotated box, pixels.
    mask : (H, W) bool or None
        True on the target.
    """

    corners: Points | None = None
    mask: Mask | None = None

    def mapped(self, to_from_from: Transform, size_wh: tuple[int, int]) -> Outline:
        """The outline in a frame of `size_wh` = (width, height) pixels (eq. 9)."""
        return Outline(
            None if self.corners is None else map_points(to_from_from, self.corners),
            None if self.mask is None else map_mask(to_from_from, self.mask, size_wh),
        )


class PendingOutline:
    """An outline that is computed when it is first read.

    Threads: any number may read it; it is computed once. Copies share the result. If it is pickled,
    it is computed first.

    Parameters
    ----------
    compute : callable
        Returns the outline; dropped with all that it holds after the first call that returns.
    """

    def __init__(self, compute: Callable[[], Outline]) -> None:
        self._compute: Callable[[], Outline] | None = compute
        self._outline = Outline()
        self._lock = Lock()

    def read(self) -> Outline:
        """The outline."""
        with self._lock:
            if self._compute is not None:
                self._outline = self._compute()
                self._compute = None
        return self._outline

    def mapped(self, to_from_from: Transform, size_wh: tuple[int, int]) -> PendingOutline:
        """The outline in a frame of `size_wh` = (width, height) pixels, pending too."""
        return PendingOutline(lambda: self.read().mapped(to_from_from, size_wh))

    def __copy__(self) -> PendingOutline:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> PendingOutline:
        return self

    def __reduce__(self) -> tuple[Callable[[Outline], PendingOutline], tuple[Outline]]:
        return _finished, (self.read(),)


def _finished(outline: Outline) -> PendingOutline:
    return PendingOutline(lambda: outline)


class _OutlineField(Generic[ValueT]):
    """A dataclass field that is read from a `PendingOutline`, if that is its value."""

    def __init__(self, name: Literal["corners", "mask"]) -> None:
        self._name = name

    @overload
    def __get__(self, track: None, owner: type) -> None: ...
    @overload
    def __get__(self, track: Track, owner: type) -> ValueT | None: ...
    def __get__(self, track: Track | None, owner: type) -> ValueT | None:
        if track is None:
            return None  # the field's default
        value = track.__dict__[self._name]
        if isinstance(value, PendingOutline):
            value = getattr(value.read(), self._name)
        return cast("ValueT | None", value)

    def __set__(self, track: Track, value: ValueT | PendingOutline | None) -> None:
        track.__dict__[self._name] = value


@dataclass(frozen=True, eq=False, repr=False)
class Track:
    """The target in one frame.

    Threads: a value; any number of threads may share it.

    A tracker may give a `PendingOutline` as corners and mask, which are then computed when one of
    them is first read.

    Attributes
    ----------
    box : (x, y, w, h) floats
        Upright box, raw-frame pixels, 0-based.
    score : float
        0..1: confidence score, the probability that the IoU of the box with the target exceeds 0.5
        (`ssiam.trackers.confidence`). Where `StabilizedTracker.score_is_calibrated` is False
        (SiamFC, SiamRPN, SiamMask, most trackers of others) it is the tracker's own score.
    lost : bool
        Whether the target is lost; the box is then a guess that should not be displayed.
    corners : (4, 2) float64 or None
        Rotated box of the mask trackers, raw-frame pixels.
    mask : (H, W) bool or None
        The target's pixels, for the mask trackers.
    motion : Motion or None
        Camera motion to this frame; None with ``stabilize="off"``.
    stab_from_raw : (3, 3) float64 or None
        Stabilization of this frame, M_t of eq. 7; None with ``stabilize="off"``.
    evidence : tuple of float
        The numbers from which the score was computed; each tracker has different ones.
    keyframe : bool
        Whether the box was given by a person: the first one, or a correction. Else it was tracked.
    """

    box: XYWH
    score: float = 1.0
    lost: bool = False
    corners: _OutlineField[Points] = _OutlineField("corners")
    mask: _OutlineField[Mask] = _OutlineField("mask")
    motion: Motion | None = None
    stab_from_raw: Transform | None = None
    evidence: tuple[float, ...] = ()
    keyframe: bool = False

    def mapped(self, to_from_from: Transform, size_wh: tuple[int, int]) -> Track:
        """Map box, corners and mask to a frame of `size_wh` = (width, height) pixels (eq. 9)."""
        outline = self._outline.mapped(to_from_from, size_wh)
        corners, mask = (
            (outline.corners, outline.mask) if isinstance(outline, Outline) else (outline, outline)
        )
        return self.with_changes(box=map_box(to_from_from, self.box), corners=corners, mask=mask)

    def with_changes(self, **changes: Any) -> Track:
        """As `dataclasses.replace`, but a pending outline is not computed.

        Raises
        ------
        TypeError
            A change is not of a field.
        """
        if not changes.keys() <= self.__dict__.keys():
            raise TypeError(
                f"a Track has no fields {sorted(changes.keys() - self.__dict__.keys())}"
            )
        changed = object.__new__(Track)  # several times as fast as the constructor
        changed.__dict__.update(self.__dict__, **changes)
        return changed

    @property
    def _outline(self) -> Outline | PendingOutline:
        corners, mask = self.__dict__["corners"], self.__dict__["mask"]
        if isinstance(mask, PendingOutline) and corners is mask:
            return mask
        return Outline(self.corners, self.mask)

    def __repr__(self) -> str:
        box = ", ".join(f"{value:.0f}" for value in self.box)
        return f"Track(box=({box}), score={self.score:.2f}{', lost=True' * self.lost})"
