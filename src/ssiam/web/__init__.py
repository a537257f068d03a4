"""The live session: frames as they arrive, targets added and removed by command, a web page.

`ssiam.web.server.serving.LiveServer` serves a `Session` to browsers, and needs the extra ``web``.
"""

from ssiam.web.session import Session
from ssiam.web.types import (
    Add,
    Advance,
    Command,
    CommandError,
    Health,
    Hold,
    Note,
    Pause,
    Record,
    Remove,
    Rename,
    Restart,
    SessionInfo,
    SessionLimits,
    Stabilize,
    Step,
    SwitchCamera,
    Target,
)

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
    "Stabilize",
    "Step",
    "SwitchCamera",
    "Target",
]
