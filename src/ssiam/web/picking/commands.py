"""The values of a picking session: commands of the page, and the state that it shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from ssiam.exchange.blending import Keyframe
from ssiam.geometry import XYWH

Phase: TypeAlias = Literal["picking", "preview", "tracking", "written"]


@dataclass(frozen=True)
class Seek:
    """Show this frame. The result is the index of the frame that is shown (int)."""

    index: int


@dataclass(frozen=True)
class AddBox:
    """Add a target that begins with this box (raw-frame pixels) in a frame; its id (int).

    With the id of a target, the box is a keyframe of that target.
    """

    frame: int
    xywh: XYWH
    id: int | None = None


@dataclass(frozen=True)
class Click:
    """Add the object at a point (raw-frame pixels) of a frame; the target's id (int).

    With the id of a target, the object's box is a keyframe of that target.
    """

    frame: int
    point_xy: tuple[float, float]
    id: int | None = None


@dataclass(frozen=True)
class MarkAbsent:
    """A target is not visible from this frame to its next keyframe."""

    frame: int
    id: int


@dataclass(frozen=True)
class Adjust:
    """Change a target's box in one of its keyframes, by default the first with a box."""

    id: int
    xywh: XYWH
    frame: int | None = None


@dataclass(frozen=True)
class Discard:
    """Remove a target, or its keyframe in one frame. Without a box left, it is removed too."""

    id: int
    frame: int | None = None


@dataclass(frozen=True)
class Undo:
    """Take back the last change of the targets."""


@dataclass(frozen=True)
class Preview:
    """Track a second from the beginning of a target, by default the earliest one.

    If the shown frame has another keyframe of the target, from that one.
    """

    id: int | None = None


@dataclass(frozen=True)
class TrackAll:
    """Choose the current targets: the whole clip is tracked now."""


@dataclass(frozen=True)
class Finish:
    """Everything was seen: the command may end."""


@dataclass(frozen=True)
class Correct:
    """Choose again after all was written, with the tracked boxes as a guide."""


PickCommand: TypeAlias = (
    Seek
    | AddBox
    | Click
    | MarkAbsent
    | Adjust
    | Discard
    | Undo
    | Preview
    | TrackAll
    | Finish
    | Correct
)


@dataclass(frozen=True)
class PickedTarget:
    """A chosen target.

    Attributes
    ----------
    id : int
    keyframes : tuple of Keyframe
        In the order of the frames; at least one has a box.
    """

    id: int
    keyframes: tuple[Keyframe, ...]

    @property
    def frame(self) -> int:
        """The frame in which it begins: the first one with a box."""
        return self._beginning()[0]

    @property
    def xywh(self) -> XYWH:
        """Its box there, raw-frame pixels."""
        return self._beginning()[1]

    def _beginning(self) -> tuple[int, XYWH]:
        return next((each.frame, each.xywh) for each in self.keyframes if each.xywh is not None)

    def keyframe(self, frame: int) -> Keyframe | None:
        """Its keyframe in a frame."""
        return next((each for each in self.keyframes if each.frame == frame), None)

    def others(self, frame: int) -> list[Keyframe]:
        """Its keyframes in all frames but one."""
        return [each for each in self.keyframes if each.frame != frame]


@dataclass(frozen=True)
class Progress:
    """How far the run is: frames done, of how many (None if unknown), frames per second."""

    done: int
    total: int | None
    fps: float | None


@dataclass(frozen=True)
class WrittenFile:
    """A file that was written: what it is ("video", ...), its name and its size in bytes."""

    kind: str
    name: str
    size: int


@dataclass(frozen=True)
class PickState:
    """All that the page shows beside the frame.

    Attributes
    ----------
    phase : {"picking", "preview", "tracking", "written"}
    length : int or None
        Number of frames of the source.
    targets : tuple of PickedTarget
    can_undo : bool
    progress : Progress or None
    files : tuple of WrittenFile
    notes : tuple of str
        What the run reported, one line each.
    """

    phase: Phase = "picking"
    length: int | None = None
    targets: tuple[PickedTarget, ...] = ()
    can_undo: bool = False
    progress: Progress | None = None
    files: tuple[WrittenFile, ...] = ()
    notes: tuple[str, ...] = ()
