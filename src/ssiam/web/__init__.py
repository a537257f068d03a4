"""The live session: frames as they come, targets that are drawn into them, a page to watch.

`ssiam.web.serving.LiveServer` serves a `Session` to browsers, and needs the extra ``web``.
"""

from ssiam.web.commands import (
    Add,
    Advance,
    Command,
    Hold,
    Pause,
    Record,
    Remove,
    Rename,
    Restart,
    Steady,
)
from ssiam.web.errors import CommandError, Health, Note
from ssiam.web.info import SessionInfo, SessionLimits
from ssiam.web.session import Session
from ssiam.web.step import Step, Target

__all__ = [
    "Add",
    "Advance",
    "Command",
    "CommandError",
    "Health",
    "Hold",
    "Note",
    "Pause",
    "Record",
    "Remove",
    "Rename",
    "Restart",
    "Session",
    "SessionInfo",
    "SessionLimits",
    "Steady",
    "Step",
    "Target",
]
