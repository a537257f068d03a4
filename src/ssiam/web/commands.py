"""What can be asked of a live session, by whoever asks: the page, a script, a ground station."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from ssiam.geometry import XYWH
from ssiam.stabilize import Method


@dataclass(frozen=True)
class Add:
    """Follow one more target; the answer is its id (int).

    Threads: a value; any number of threads may share it.

    `xywh` is in raw-frame pixels of the step called `number`, or of the newest one if that is
    None. A step that was shown a moment ago is as good as the newest: the session catches up.
    """

    xywh: XYWH
    number: int | None = None
    name: str | None = None


@dataclass(frozen=True)
class Hold:
    """Somebody draws into the step called `number`: keep it until the box is there.

    Threads: a value; any number of threads may share it.
    """

    number: int


@dataclass(frozen=True)
class Remove:
    """Follow a target no longer; None means all of them.

    Threads: a value; any number of threads may share it.
    """

    id: int | None = None


@dataclass(frozen=True)
class Rename:
    """Call a target by another name.

    Threads: a value; any number of threads may share it.
    """

    id: int
    name: str


@dataclass(frozen=True)
class Steady:
    """Steady by another method from now on; the targets are kept.

    Threads: a value; any number of threads may share it.
    """

    method: Method


@dataclass(frozen=True)
class Pause:
    """Stand still (True) or go on (False).

    Threads: a value; any number of threads may share it.
    """

    paused: bool


@dataclass(frozen=True)
class Advance:
    """Go on by one frame, and pause.

    Threads: a value; any number of threads may share it.
    """


@dataclass(frozen=True)
class Restart:
    """Begin a file again; every target starts anew where it was first drawn.

    Threads: a value; any number of threads may share it.
    """


@dataclass(frozen=True)
class Record:
    """Begin (True) or end (False) a recording; the answer is its name (str).

    Threads: a value; any number of threads may share it.
    """

    recording: bool


Command: TypeAlias = Add | Hold | Remove | Rename | Steady | Pause | Advance | Restart | Record
