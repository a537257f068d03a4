"""`CommandReader`: the commands for the camera among the bytes that come in."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from ssiam.web.mavlink.messages import Message, dialect

_MARKER: Final = re.compile(rb"[\xfd\xfe]")
_V2: Final = 0xFD
_SIGNED: Final = 1  # the only flag of a frame that may be set
_SIGNATURE: Final = 13  # bytes
_FIRST: Final = ("param1", "param2", "param3", "param4")
_PARAMS: Final = {
    "COMMAND_LONG": (*_FIRST, "param5", "param6", "param7"),
    "COMMAND_INT": (*_FIRST, "x", "y", "z"),
}
# Where a command says which camera of several it is for (0: all, or the one addressed).
_DEVICE: Final = {
    dialect.MAV_CMD_CAMERA_TRACK_POINT: 3,
    dialect.MAV_CMD_CAMERA_TRACK_RECTANGLE: 4,
    dialect.MAV_CMD_CAMERA_STOP_TRACKING: 0,
}


@dataclass(frozen=True)
class Asked:
    """A command as it came, COMMAND_LONG or COMMAND_INT.

    Attributes
    ----------
    command : int
        MAV_CMD.
    params : tuple of seven floats
    sender : (int, int)
        System and component.
    repeated : bool
        Sent once more, because no answer had come.
    broadcast : bool
        To everybody.
    """

    command: int
    params: tuple[float, ...]
    sender: tuple[int, int]
    repeated: bool
    broadcast: bool


class CommandReader:
    """Cuts bytes into frames, whatever they are, and keeps the commands for one component.

    Parameters
    ----------
    system, component : int
        Commands for these, or for 0, are taken.
    """

    def __init__(self, system: int, component: int) -> None:
        self._system, self._component = system, component
        self._mavlink = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._buffer = bytearray()

    def commands(self, data: bytes, *, whole: bool) -> Iterator[Asked]:
        """The commands in `data` and what was left over before.

        `whole`: no more of the last frame will come, because this was a datagram or nothing came
        for a while; what looked like its beginning was none. What follows on a damaged frame is
        thrown away then: a datagram full of them would take long.
        """
        self._buffer += data
        while frame := self._next_frame(whole=whole):
            message = self._decoded(frame)
            if message is None:
                del self._buffer[: len(self._buffer) if whole else 1]
                continue
            del self._buffer[: len(frame)]
            asked = self._asked(message)
            if asked is not None:
                yield asked

    def _next_frame(self, *, whole: bool) -> bytearray | None:
        """The first frame of the buffer, not checked, and all before it thrown away."""
        while marker := _MARKER.search(self._buffer):
            del self._buffer[: marker.start()]
            length = _length(self._buffer)
            if length is not None and length <= len(self._buffer):
                return self._buffer[:length]
            if not whole:
                return None
            del self._buffer[:1]
        self._buffer.clear()
        return None

    def _decoded(self, frame: bytearray) -> Message | None:
        if frame[0] == _V2 and frame[2] & ~_SIGNED:
            return None
        try:
            return self._mavlink.decode(frame)
        except Exception:
            # pymavlink raises more than its own MAVError; no frame may keep others from being read.
            return None

    def _asked(self, message: Message) -> Asked | None:
        names = _PARAMS.get(message.get_type())
        if names is None or message.target_system not in (0, self._system):
            return None
        if message.target_component not in (0, self._component):
            return None
        asked = Asked(
            command=message.command,
            params=tuple(float(getattr(message, name)) for name in names),
            sender=(message.get_srcSystem(), message.get_srcComponent()),
            repeated=getattr(message, "confirmation", 0) > 0,
            broadcast=0 in (message.target_system, message.target_component),
        )
        return asked if self._is_meant(asked) else None

    def _is_meant(self, asked: Asked) -> bool:
        place = _DEVICE.get(asked.command)
        if place is None or not asked.broadcast:
            return True
        device = asked.params[place]
        return math.isnan(device) or device in (0, self._component)


class Budget:
    """At most so much a second."""

    def __init__(self, a_second: int) -> None:
        self._a_second = a_second
        self._began, self._spent = -math.inf, 0

    def take(self, amount: int) -> bool:
        """Whether there was something left of this second before `amount` was taken."""
        now = time.monotonic()
        if now >= self._began + 1:
            self._began, self._spent = now, 0
        self._spent += amount
        return self._spent - amount < self._a_second

    def seconds_left(self) -> float:
        """Until there is something left again; 0 if there is."""
        if self._spent < self._a_second:
            return 0.0
        return max(0.0, self._began + 1 - time.monotonic())


def _length(frame: bytearray) -> int | None:
    """Bytes of the frame that begins here; None as long as nobody can know."""
    if len(frame) < 3:
        return None
    if frame[0] != _V2:
        return 8 + frame[1]
    return 12 + frame[1] + (_SIGNATURE if frame[2] & _SIGNED else 0)
