"""What a live session shows, and what it bears."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SessionLimits:
    """What a session bears.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    targets : int
        At a time.
    """

    targets: int = 16


@dataclass(frozen=True)
class SessionInfo:
    """What a session shows; sizes in pixels, `length` in frames, None where nobody knows.

    Threads: a value; any number of threads may share it.
    """

    source: str
    size_wh: tuple[int, int] | None
    fps: float | None
    length: int | None
    tracker: str
    seekable: bool
    webcam: bool
