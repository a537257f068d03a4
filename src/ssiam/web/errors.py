"""What a live session tells people: commands that failed, and notes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from ssiam.errors import SsiamError

Code: TypeAlias = Literal[
    "bad-message",
    "bad-box",
    "no-such-target",
    "too-many-targets",
    "too-old",
    "not-possible",
    "failed",
]
Level: TypeAlias = Literal["info", "warning", "error"]
HealthState: TypeAlias = Literal["running", "stalled", "failed"]


class CommandError(SsiamError):
    """A command that a live session cannot carry out.

    Attributes
    ----------
    code : str
        For programs, as docs/reference/live-protocol.md lists them; the text is for people.
    """

    def __init__(self, code: Code, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class Health:
    """Whether a session's targets are still tracked.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    state : {"running", "stalled", "failed"}
        stalled: a frame or a command takes very long, and may never end; nothing else is done
        meanwhile. failed: tracking has ended for good.
    message : str
        One line for people; empty while it is running.
    """

    state: HealthState = "running"
    message: str = ""


@dataclass(frozen=True)
class Note:
    """One line for the people who watch a session; never holds a password.

    Threads: a value; any number of threads may share it.
    """

    level: Level
    message: str
