"""`Step`: all that a live session knows after one frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from ssiam.geometry import Transform
from ssiam.motion import Motion
from ssiam.stabilize import Method
from ssiam.track import Track
from ssiam.video import Frame

Playing: TypeAlias = Literal["playing", "paused", "reconnecting", "ended"]


@dataclass(frozen=True, eq=False)
class Target:
    """One target of a session in one frame.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    id : int
        From 1; never given twice in a session.
    name : str
    colour : str
        ``#rrggbb``.
    track : Track
        Raw-frame pixels.
    found : bool
        Whether this is the first frame since it was lost.
    error : str
        Why its tracker has failed on this frame, one line; empty if it has not. The target counts
        as lost then.
    """

    id: int
    name: str
    colour: str
    track: Track
    found: bool = False
    error: str = ""


@dataclass(frozen=True, eq=False)
class Step:
    """One frame of a session, with everything that was made of it.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    number : int
        Counts the session's steps from 1, also over restarts of its source.
    frame : Frame
    targets : tuple of Target
    motion : Motion or None
        The camera's motion since the step before; None with ``stabilize="off"``.
    stab_from_raw : (3, 3) float64
        The steadied view for people to look at: the paper's (eq. 7), whatever the trackers use.
    stabilize : str
        What the trackers use.
    arrived, done : float
        When the frame came and when its targets were known, seconds of `time.monotonic`.
    fps : float
        Steps a second, of late.
    dropped : int
        Frames that came and were left out for newer ones, since the session began.
    playing : {"playing", "paused", "reconnecting", "ended"}
    recording : str or None
        Name of the recording that is being written.
    error : str
        What went wrong with the frame as a whole, one line; empty if nothing did.
    """

    number: int
    frame: Frame
    targets: tuple[Target, ...]
    motion: Motion | None
    stab_from_raw: Transform
    stabilize: Method
    arrived: float
    done: float
    fps: float
    dropped: int
    playing: Playing
    recording: str | None = None
    error: str = ""
