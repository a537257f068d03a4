"""`CameraService`: executes commands of MAVLink's camera protocol on a session."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from ssiam.errors import SsiamError
from ssiam.geometry import XYWH
from ssiam.web.mavlink.commands import ReceivedCommand
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
from ssiam.web.types import Add, CommandError, Remove, Step

if TYPE_CHECKING:
    from ssiam.web.session import Session

_log = logging.getLogger(__name__)

_ACCEPTED: Final[int] = dialect.MAV_RESULT_ACCEPTED
_DENIED: Final[int] = dialect.MAV_RESULT_DENIED
_FAILED: Final[int] = dialect.MAV_RESULT_FAILED
_TEMPORARILY_REJECTED: Final[int] = dialect.MAV_RESULT_TEMPORARILY_REJECTED
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
_MAX_PENDING: Final = 4  # commands that the session has not answered yet

_IDLE: Final[int] = dialect.CAMERA_TRACKING_STATUS_FLAGS_IDLE
_IDLE_INTERVAL: Final = 1.0  # seconds, the default without a target
_DISABLED, _DEFAULT = -1, 0  # special values of MAV_CMD_SET_MESSAGE_INTERVAL, not microseconds


class CameraService:
    """Executes MAVLink commands on a session, and makes the messages that answer them.

    `handle` and `results` must be called on one thread; `status_after` may be called on another.
    None of them blocks.

    Parameters
    ----------
    session : Session
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._target = _StationTarget(session)
        self._interval = StatusInterval()
        self._last: ReceivedCommand | None = None
        self._last_result: int | None = None
        self._started = time.monotonic()

    def handle(self, command: ReceivedCommand) -> Iterator[Message]:
        """Execute a command; yields the messages to be sent at once.

        A command that is sent again, because its answer was lost or is late, is executed once.
        """
        if command.repeated and self._is_last(command):
            result = self._last_result
        else:
            self._last, self._last_result = command, None
            result = self._execute(command)
        if result is not None:
            yield from self._answer(command, result)

    def results(self) -> Iterator[Message]:
        """The answers to commands that the session has executed since the last call."""
        for command, result in self._target.results():
            yield from self._answer(command, result)

    def status_after(self, step: Step) -> Iterator[Message]:
        """The tracking status after a step, if it is due."""
        status = self._status(step)
        if self._interval.is_due(status.tracking_status):
            yield status

    def _answer(self, command: ReceivedCommand, result: int) -> Iterator[Message]:
        if self._is_last(command):
            self._last_result = result
        if command.broadcast and result == _UNSUPPORTED:
            return  # it is for another component
        yield acknowledgement(command.command, result, command.sender)
        message = self._requested_message(command) if result == _ACCEPTED else None
        if message is not None:
            yield message

    def _is_last(self, command: ReceivedCommand) -> bool:
        last = self._last
        return (
            last is not None
            and (last.command, last.sender) == (command.command, command.sender)
            and last.params == command.params
        )

    def _execute(self, command: ReceivedCommand) -> int | None:
        """The MAV_RESULT; None if the session has to answer first."""
        if command.command in _BOXES:
            return self._start_tracking(command)
        if command.command == dialect.MAV_CMD_CAMERA_STOP_TRACKING:
            return self._target.stop(command)
        if command.command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
            message, microseconds = command.params[:2]
            is_set = message == _STATUS and self._interval.set(microseconds)
            return _ACCEPTED if is_set else _DENIED
        requested = _requested_id(command)
        if requested is None:
            return _UNSUPPORTED
        if requested == _STATUS and self._session.newest is None:
            return _TEMPORARILY_REJECTED
        return _DENIED if self._requested_message(command) is None else _ACCEPTED

    def _start_tracking(self, command: ReceivedCommand) -> int | None:
        box, mode = _BOXES[command.command]
        if box(command.params, (1, 1)) is None:
            return _DENIED
        step = self._session.newest
        if step is None:
            return _TEMPORARILY_REJECTED
        height, width = step.frame.image.shape[:2]
        xywh = box(command.params, (width, height))
        return _DENIED if xywh is None else self._target.start(command, xywh, mode)

    def _requested_message(self, command: ReceivedCommand) -> Message | None:
        """The message that a command requests; None for other commands and unknown messages."""
        requested, step = _requested_id(command), self._session.newest
        boot_ms = int((time.monotonic() - self._started) * 1000) % 2**32
        if requested == dialect.MAVLINK_MSG_ID_CAMERA_INFORMATION:
            return information(self._session.info.size_wh, boot_ms)
        if requested == dialect.MAVLINK_MSG_ID_CAMERA_SETTINGS:
            return settings(boot_ms)
        if requested == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            return heartbeat()
        return self._status(step) if requested == _STATUS and step is not None else None

    def _status(self, step: Step) -> Message:
        current = self._target.current
        return tracking_status(step, current.id, current.mode)


def _requested_id(command: ReceivedCommand) -> float | None:
    """The id of the message that a command requests; None for other commands."""
    if command.command == dialect.MAV_CMD_REQUEST_MESSAGE:
        return command.params[0]
    return _REQUESTS.get(command.command)


class StatusInterval:
    """When the tracking status is due.

    By default: at every step while a target is tracked, else once per second. `set` and `is_due`
    may be called on different threads.

    Parameters
    ----------
    clock : callable
        Seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._interval: float | None = None  # seconds; None for the default
        self._next = -math.inf
        self._last_status = _IDLE

    def set(self, microseconds: float) -> bool:
        """Set the interval by MAV_CMD_SET_MESSAGE_INTERVAL; False if the value is invalid."""
        if microseconds == _DEFAULT:
            self._interval = None
        elif microseconds == _DISABLED:
            self._interval = math.inf
        elif 0 < microseconds < math.inf:
            self._interval = microseconds / 1e6
        else:
            return False
        return True

    def is_due(self, status: int) -> bool:
        """Whether to send `status` now. If so, it counts as sent."""
        now, interval = self._clock(), self._interval
        if interval is None:
            interval = _IDLE_INTERVAL if status == self._last_status == _IDLE else 0.0
        # A shorter interval takes effect at once.
        self._next = min(self._next, now + interval)
        if interval == math.inf or now < self._next:
            return False
        # The interval is met on average, although it is not a multiple of the time between steps.
        is_late = now - self._next >= interval
        self._next = (now if is_late else self._next) + interval
        self._last_status = status
        return True


@dataclass(frozen=True)
class _CurrentTarget:
    """The station's target: its id, None if there is none, and its tracking mode."""

    id: int | None = None
    mode: int = RECTANGLE


@dataclass(frozen=True)
class _PendingCommand:
    """A command that was submitted to the session."""

    command: ReceivedCommand
    answer: Future[Any]
    mode: int | None  # of the target to be added; None if one was removed
    turn: int


class _StationTarget:
    """The one target that the ground station started; targets of others are not changed.

    No method blocks: `results` yields what the session has answered. `current` may be read on any
    thread; the methods must be called on one thread.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._pending: list[_PendingCommand] = []
        self._turn = 0  # counts the commands
        self.current = _CurrentTarget()

    def start(self, command: ReceivedCommand, xywh: XYWH, mode: int) -> int | None:
        """Track what is in `xywh` (raw-frame pixels) instead of the previous target.

        Returns the MAV_RESULT if it is known at once; None if `results` will yield it.
        """
        if len(self._pending) >= _MAX_PENDING:
            return _TEMPORARILY_REJECTED
        self._remove_current()
        answer = self._session.submit(Add(xywh))
        self._pending.append(_PendingCommand(command, answer, mode, self._turn))
        return None

    def stop(self, command: ReceivedCommand) -> int | None:
        """Remove the target; returns as `start`."""
        answer = self._remove_current()
        if answer is None:
            return _ACCEPTED
        self._pending.append(_PendingCommand(command, answer, None, self._turn))
        return None

    def results(self) -> Iterator[tuple[ReceivedCommand, int]]:
        """Commands that the session has answered since the last call, with their MAV_RESULT."""
        answered = [each for each in self._pending if each.answer.done()]
        self._pending = [each for each in self._pending if each not in answered]
        for each in answered:
            result = _mav_result(each.answer)
            if each.mode is None:
                # The target no longer exists, whoever removed it.
                result = _ACCEPTED
            elif result == _ACCEPTED:
                self._set_current(each.answer.result(), each.mode, each.turn)
            yield each.command, result

    def _set_current(self, id: int, mode: int, turn: int) -> None:
        if turn == self._turn:
            self.current = _CurrentTarget(id, mode)
        else:
            # A newer command arrived while the session executed this one.
            self._session.submit(Remove(id))

    def _remove_current(self) -> Future[Any] | None:
        self._turn += 1
        id, self.current = self.current.id, _CurrentTarget()
        return None if id is None else self._session.submit(Remove(id))


def _mav_result(answer: Future[Any]) -> int:
    """The MAV_RESULT for the session's answer to a command."""
    if answer.cancelled():
        return _FAILED
    error = answer.exception()
    if error is None:
        return _ACCEPTED
    if not isinstance(error, SsiamError):
        _log.error("a MAVLink command failed", exc_info=error)
    if isinstance(error, CommandError) and error.code == "bad-box":
        return _DENIED
    return _FAILED
