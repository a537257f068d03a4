"""`Desk`: what is said to each command of a ground station."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from ssiam.web.mavlink.commands import Asked
from ssiam.web.mavlink.messages import (
    POINT,
    RECTANGLE,
    Message,
    acknowledgement,
    dialect,
    heartbeat,
    information,
    point_box,
    rectangle_box,
    settings,
    tracking_status,
)
from ssiam.web.mavlink.pace import Pace
from ssiam.web.mavlink.tracking import OwnTarget
from ssiam.web.step import Step

if TYPE_CHECKING:
    from ssiam.web.session import Session

_ACCEPTED: Final[int] = dialect.MAV_RESULT_ACCEPTED
_DENIED: Final[int] = dialect.MAV_RESULT_DENIED
_LATER: Final[int] = dialect.MAV_RESULT_TEMPORARILY_REJECTED
_UNSUPPORTED: Final[int] = dialect.MAV_RESULT_UNSUPPORTED
_STATUS: Final[int] = dialect.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS
_BOXES: Final = {
    dialect.MAV_CMD_CAMERA_TRACK_RECTANGLE: (rectangle_box, RECTANGLE),
    dialect.MAV_CMD_CAMERA_TRACK_POINT: (point_box, POINT),
}
_REQUESTS: Final = {
    dialect.MAV_CMD_REQUEST_CAMERA_INFORMATION: dialect.MAVLINK_MSG_ID_CAMERA_INFORMATION,
    dialect.MAV_CMD_REQUEST_CAMERA_SETTINGS: dialect.MAVLINK_MSG_ID_CAMERA_SETTINGS,
}


class Desk:
    """Has the session carry out commands, and makes the messages that answer them.

    `handle` and `answers` are for one thread, `news` for another; none of them waits.

    Parameters
    ----------
    session : Session
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._own = OwnTarget(session)
        self._pace = Pace()
        self._last: Asked | None = None
        self._last_result: int | None = None
        self._born = time.monotonic()

    def handle(self, asked: Asked) -> Iterator[Message]:
        """Take a command; what is to be sent at once.

        One that came twice, because its answer got lost or takes long, is carried out once.
        """
        if asked.repeated and self._is_last(asked):
            result = self._last_result
        else:
            self._last, self._last_result = asked, None
            result = self._carry_out(asked)
        if result is not None:
            yield from self._answer(asked, result)

    def answers(self) -> Iterator[Message]:
        """What is to be sent because the session has answered."""
        for asked, result in self._own.answered():
            yield from self._answer(asked, result)

    def news(self, step: Step) -> Iterator[Message]:
        """The status after a step, if it is due."""
        status = self._status(step)
        if self._pace.is_due(status.tracking_status):
            yield status

    def _answer(self, asked: Asked, result: int) -> Iterator[Message]:
        if self._is_last(asked):
            self._last_result = result
        if asked.broadcast and result == _UNSUPPORTED:
            return  # others will know it
        yield acknowledgement(asked.command, result, asked.sender)
        message = self._requested(asked) if result == _ACCEPTED else None
        if message is not None:
            yield message

    def _is_last(self, asked: Asked) -> bool:
        last = self._last
        return (
            last is not None
            and (last.command, last.sender) == (asked.command, asked.sender)
            and last.params == asked.params
        )

    def _carry_out(self, asked: Asked) -> int | None:
        """The MAV_RESULT, or None where the session has to answer first."""
        if asked.command in _BOXES:
            return self._begin(asked)
        if asked.command == dialect.MAV_CMD_CAMERA_STOP_TRACKING:
            return self._own.end(asked)
        if asked.command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
            is_known = asked.params[0] == _STATUS and self._pace.ask(asked.params[1])
            return _ACCEPTED if is_known else _DENIED
        wanted = _wanted(asked)
        if wanted is None:
            return _UNSUPPORTED
        if wanted == _STATUS and self._session.newest is None:
            return _LATER
        return _DENIED if self._requested(asked) is None else _ACCEPTED

    def _begin(self, asked: Asked) -> int | None:
        box, mode = _BOXES[asked.command]
        if box(asked.params, (1, 1)) is None:
            return _DENIED
        step = self._session.newest
        if step is None:
            return _LATER
        height, width = step.frame.image.shape[:2]
        xywh = box(asked.params, (width, height))
        return _DENIED if xywh is None else self._own.begin(asked, xywh, mode)

    def _requested(self, asked: Asked) -> Message | None:
        """The message that a command asks for; None if it asks for none, or for an unknown one."""
        wanted, step = _wanted(asked), self._session.newest
        boot_ms = int((time.monotonic() - self._born) * 1000) % 2**32
        if wanted == dialect.MAVLINK_MSG_ID_CAMERA_INFORMATION:
            return information(self._session.info.size_wh, boot_ms)
        if wanted == dialect.MAVLINK_MSG_ID_CAMERA_SETTINGS:
            return settings(boot_ms)
        if wanted == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            return heartbeat()
        return self._status(step) if wanted == _STATUS and step is not None else None

    def _status(self, step: Step) -> Message:
        shown = self._own.shown
        return tracking_status(step, shown.id, shown.mode)


def _wanted(asked: Asked) -> float | None:
    """The number of the message that a command asks for; None if it is no such command."""
    if asked.command == dialect.MAV_CMD_REQUEST_MESSAGE:
        return asked.params[0]
    return _REQUESTS.get(asked.command)
