"""The values of a live session's interface: commands in, steps and messages out.

They are frozen; docs/reference/live-protocol.md documents their JSON form.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Final, Literal, TypeAlias

from ssiam.errors import SsiamError
from ssiam.geometry import XYWH, Transform
from ssiam.motion import Motion
from ssiam.stabilize import Method
from ssiam.track import Track
from ssiam.video import Frame

ErrorCode: TypeAlias = Literal[
    "bad-message",
    "bad-box",
    "no-such-target",
    "too-many-targets",
    "too-old",
    "not-possible",
    "failed",
]
NoteLevel: TypeAlias = Literal["info", "warning", "error"]
HealthState: TypeAlias = Literal["running", "stalled", "failed"]
Playback: TypeAlias = Literal["playing", "paused", "reconnecting", "ended"]
CameraName: TypeAlias = Literal["stabilized", "locked"]
"""Virtual cameras: the whole image still, or the first target held in its middle."""

MAX_NAME_LENGTH: Final = 40  # characters of a target's name


class CommandError(SsiamError):
    """A command that a live session cannot carry out.

    Attributes
    ----------
    code : str
        Machine-readable reason (docs/reference/live-protocol.md). The message is for users.
    """

    def __init__(self, code: ErrorCode, message: str) -> None:
        super().__init__(message)
        self.code = code


def normalized_name(name: str) -> str | None:
    """A target's name with its white space normalized; None if it cannot be used."""
    name = " ".join(name.split())
    # `isprintable` also rejects lone surrogates, which could not be encoded.
    return name if 0 < len(name) <= MAX_NAME_LENGTH and name.isprintable() else None


@dataclass(frozen=True)
class Add:
    """Track one more target. The result is its id (int).

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    xywh : (x, y, w, h)
        Box in raw-frame pixels.
    number : int, optional
        Step into which the box was drawn, by default the newest one. The session tracks the
        target from that step through the frames that followed.
    name : str, optional
        By default ``target ID``.
    """

    xywh: XYWH
    number: int | None = None
    name: str | None = None


@dataclass(frozen=True)
class Hold:
    """Keep step `number` available, because a box is being drawn into it.

    Threads: a value; any number of threads may share it.
    """

    number: int


@dataclass(frozen=True)
class Remove:
    """Stop tracking the target with this id; None stops all.

    Threads: a value; any number of threads may share it.
    """

    id: int | None = None


@dataclass(frozen=True)
class Rename:
    """Rename a target.

    Threads: a value; any number of threads may share it.
    """

    id: int
    name: str


@dataclass(frozen=True)
class Stabilize:
    """Switch the stabilization method of all targets' trackers; the targets are kept.

    Threads: a value; any number of threads may share it.
    """

    method: Method


@dataclass(frozen=True)
class SwitchCamera:
    """Switch the virtual camera of the view beside the raw frame, from the next frame on.

    Threads: a value; any number of threads may share it.
    """

    camera: CameraName


@dataclass(frozen=True)
class Pause:
    """Pause (True) or resume (False).

    Threads: a value; any number of threads may share it.
    """

    paused: bool


@dataclass(frozen=True)
class Advance:
    """Process one more frame, and pause.

    Threads: a value; any number of threads may share it.
    """


@dataclass(frozen=True)
class Restart:
    """Play a file from a frame on; each target starts again where it was first drawn.

    Targets that were drawn before that frame wait until the file is played from an earlier one.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    index : int
        Frame number, from 0.
    """

    index: int = 0


@dataclass(frozen=True)
class Record:
    """Start (True) or stop (False) a recording. The result is its name (str).

    Threads: a value; any number of threads may share it.
    """

    recording: bool


Command: TypeAlias = (
    Add | Hold | Remove | Rename | Stabilize | SwitchCamera | Pause | Advance | Restart | Record
)


@dataclass(frozen=True, eq=False)
class Target:
    """The state of one target in one frame.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    id : int
        From 1; never reused within a session.
    name : str
    color : str
        ``#rrggbb``.
    track : Track
        Raw-frame pixels.
    redetected : bool
        True on the first frame after the target was lost.
    error : str
        Why its tracker failed on this frame, one line; empty if it did not. The target counts as
        lost in this frame.
    """

    id: int
    name: str
    color: str
    track: Track
    redetected: bool = False
    error: str = ""


@dataclass(frozen=True)
class WaitingTarget:
    """A target that is not tracked in a frame: it begins in another one of the file.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    id, name, color
        As in `Target`.
    frame : int
        Index of the frame in which it was drawn.
    """

    id: int
    name: str
    color: str
    frame: int


@dataclass(frozen=True, eq=False)
class Step:
    """One frame of a session and its results.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    number : int
        Number of the step, from 1 on; restarts of the source do not reset it.
    frame : Frame
    targets : tuple of Target
        Those that are tracked.
    motion : Motion or None
        Camera motion since the previous frame; None with ``stabilize="off"``.
    stab_from_raw : (3, 3) float64
        Transform to the view beside the raw frame: a virtual camera without delay
        (`ssiam.render`), whichever method the trackers use; the identity with ``"off"``.
    stabilize : str
        Method of the trackers.
    arrived, done : float
        When the frame arrived and when its targets were known, seconds of `time.monotonic`.
    fps : float
        Recent rate of steps, per second.
    dropped : int
        Frames that were replaced by newer ones before they could be processed, since the session
        began.
    playback : {"playing", "paused", "reconnecting", "ended"}
    recording : str or None
        Name of the open recording.
    error : str
        Why the frame as a whole could not be processed, one line; empty if it could.
    waiting : tuple of WaitingTarget
        Targets that are not tracked in this frame, after a restart of the file.
    camera : {"stabilized", "locked"}
        The virtual camera of the next frame.
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
    playback: Playback
    recording: str | None = None
    error: str = ""
    waiting: tuple[WaitingTarget, ...] = ()
    camera: CameraName = "stabilized"


@dataclass(frozen=True)
class Health:
    """Whether a session still tracks its targets.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    state : {"running", "stalled", "failed"}
        stalled: a frame or a command takes very long and may never finish; nothing else is
        processed until it does. failed: tracking has ended because of an error.
    message : str
        One line for users; empty while running.
    """

    state: HealthState = "running"
    message: str = ""


@dataclass(frozen=True)
class Note:
    """A message of one line for users of a session; never contains a password.

    Threads: a value; any number of threads may share it.
    """

    level: NoteLevel
    message: str


@dataclass(frozen=True)
class SessionLimits:
    """Limits of a session.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    targets : int
        Maximum number of targets at a time.
    """

    targets: int = 16


@dataclass(frozen=True)
class SessionInfo:
    """Source and tracker of a session.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    source : str
        Name of the source, without a password.
    size_wh : (int, int) or None
        Frame size in pixels; None until it is known.
    fps : float or None
        Frames per second; None if unknown.
    length : int or None
        Number of frames; None for live sources.
    tracker : str
    seekable : bool
        Whether `Restart` works.
    webcam : bool
        Whether frames come from a browser.
    pixel_aspect : Fraction
        Width of a pixel divided by its height, for players.
    """

    source: str
    size_wh: tuple[int, int] | None
    fps: float | None
    length: int | None
    tracker: str
    seekable: bool
    webcam: bool
    pixel_aspect: Fraction = Fraction(1)
