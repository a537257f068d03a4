"""`CommandReader`: finds the commands for the camera in a stream of bytes."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from ssiam.web.mavlink.messages import Message, dialect

_START_BYTE: Final = re.compile(rb"[\xfd\xfe]")
_V2: Final = 0xFD
_SIGNED: Final = 1  # the only flag that a frame may have set
_SIGNATURE_BYTES: Final = 13
_FIRST_PARAMS: Final = ("param1", "param2", "param3", "param4")
_PARAMS: Final = {
    "COMMAND_LONG": (*_FIRST_PARAMS, "param5", "param6", "param7"),
    "COMMAND_INT": (*_FIRST_PARAMS, "x", "y", "z"),
}
# Index of the parameter with the camera's device id (0: all, or the addressed component).
_DEVICE_PARAM: Final = {
    dialect.MAV_CMD_CAMERA_TRACK_POINT: 3,
    dialect.MAV_CMD_CAMERA_TRACK_RECTANGLE: 4,
    dialect.MAV_CMD_CAMERA_STOP_TRACKING: 0,
}


@dataclass(frozen=True)
class ReceivedCommand:
    """A COMMAND_LONG or COMMAND_INT.

    Attributes
    ----------
    command : int
        MAV_CMD.
    params : tuple of seven floats
    sender : (int, int)
        System and component.
    repeated : bool
        Whether it is sent again because no answer had arrived.
    broadcast : bool
        Whether it is addressed to all systems or components.
    """

    command: int
    params: tuple[float, ...]
    sender: tuple[int, int]
    repeated: bool
    broadcast: bool


class CommandReader:
    """Splits arbitrary bytes into frames, and selects the commands for one component.

    Parameters
    ----------
    system, component : int
        Commands to these, or to 0, are selected.
    """

    def __init__(self, system: int, component: int) -> None:
        self._system, self._component = system, component
        self._mavlink = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._buffer = bytearray()

    def commands(self, data: bytes, *, is_complete: bool) -> Iterator[ReceivedCommand]:
        """The commands in the buffered bytes and `data`.

        Parameters
        ----------
        data : bytes
        is_complete : bool
            Whether `data` ends the last frame, because it is a datagram or the link was silent.
            The start of a longer frame is then skipped, and all bytes after a damaged frame are
            discarded: a datagram full of damaged frames would take long to search.
        """
        self._buffer += data
        while frame := self._next_frame(is_complete=is_complete):
            message = self._decode(frame)
            if message is None:
                del self._buffer[: len(self._buffer) if is_complete else 1]
                continue
            del self._buffer[: len(frame)]
            command = self._command_in(message)
            if command is not None:
                yield command

    def _next_frame(self, *, is_complete: bool) -> bytearray | None:
        """The first frame in the buffer, unchecked; the bytes before it are discarded."""
        while start := _START_BYTE.search(self._buffer):
            del self._buffer[: start.start()]
            length = _frame_length(self._buffer)
            if length is not None and length <= len(self._buffer):
                return self._buffer[:length]
            if not is_complete:
                return None
            del self._buffer[:1]
        self._buffer.clear()
        return None

    def _decode(self, frame: bytearray) -> Message | None:
        if frame[0] == _V2 and frame[2] & ~_SIGNED:
            return None
        try:
            return self._mavlink.decode(frame)
        except Exception:
            # pymavlink raises more than its MAVError; no frame may stop the reader.
            return None

    def _command_in(self, message: Message) -> ReceivedCommand | None:
        names = _PARAMS.get(message.get_type())
        if names is None or message.target_system not in (0, self._system):
            return None
        if message.target_component not in (0, self._component):
            return None
        command = ReceivedCommand(
            command=message.command,
            params=tuple(float(getattr(message, name)) for name in names),
            sender=(message.get_srcSystem(), message.get_srcComponent()),
            repeated=getattr(message, "confirmation", 0) > 0,
            broadcast=0 in (message.target_system, message.target_component),
        )
        return command if self._is_for_this_device(command) else None

    def _is_for_this_device(self, command: ReceivedCommand) -> bool:
        index = _DEVICE_PARAM.get(command.command)
        if index is None or not command.broadcast:
            return True
        device = command.params[index]
        return math.isnan(device) or device in (0, self._component)


class RateLimit:
    """A maximum amount per second, counted in windows of a second."""

    def __init__(self, per_second: int) -> None:
        self._per_second = per_second
        self._window_start, self._used = -math.inf, 0

    def take(self, amount: int) -> bool:
        """Use `amount`; return False if the limit of this second had been reached before."""
        now = time.monotonic()
        if now >= self._window_start + 1:
            self._window_start, self._used = now, 0
        self._used += amount
        return self._used - amount < self._per_second

    def seconds_left(self) -> float:
        """Seconds until `take` succeeds again; 0 if it does now."""
        if self._used < self._per_second:
            return 0.0
        return max(0.0, self._window_start + 1 - time.monotonic())


def _frame_length(frame: bytearray) -> int | None:
    """Length in bytes of the frame that starts here; None if its header is incomplete."""
    if len(frame) < 3:
        return None
    if frame[0] != _V2:
        return 8 + frame[1]
    return 12 + frame[1] + (_SIGNATURE_BYTES if frame[2] & _SIGNED else 0)
