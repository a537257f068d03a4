"""`MavlinkCamera`: a live session as a MAVLink camera that tracks."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from ssiam.errors import ArgumentError
from ssiam.web.mavlink.commands import Asked, Budget, CommandReader
from ssiam.web.mavlink.desk import Desk
from ssiam.web.mavlink.links import open_link
from ssiam.web.mavlink.messages import COMPONENT, Message, dialect, heartbeat
from ssiam.web.step import Step
from ssiam.web.troubles import Troubles

if TYPE_CHECKING:
    from ssiam.web.session import Session

_LOOK: Final = 0.02  # seconds for bytes to come, before the session's answers are looked at
_PAUSE: Final = 0.2  # seconds; radios make shorter ones within a frame
_HEARTBEAT: Final = 1.0  # seconds
_BYTES: Final = 65536  # a second that are read; more is left to the system to drop
_COMMANDS: Final = 20  # a second that are carried out; more are not answered


class MavlinkCamera:
    """Takes a ground station's tracking commands, and tells it where the target is.

    A context manager with two threads of its own: one reads and carries out, one sends. The
    session's thread never waits for either.

    Parameters
    ----------
    session : Session
    address : str
        See `open_link`.
    system : int
        The MAVLink system that this camera belongs to, 1 to 255; its component is 100.

    Raises
    ------
    ArgumentError
        The address or the system cannot be used.
    MissingExtraError
        On import of this module, where pymavlink is not installed.
    """

    def __init__(self, session: Session, address: str, *, system: int = 1) -> None:
        if not 1 <= system <= 255:
            raise ArgumentError(f"MAVLink system {system}: choose one from 1 to 255")
        self._link = open_link(address)
        self._reader = CommandReader(system, COMPONENT)
        self._desk = Desk(session)
        self._troubles = Troubles(session.say)
        self._bytes, self._commands = Budget(_BYTES), Budget(_COMMANDS)
        self._mavlink = dialect.MAVLink(None, srcSystem=system, srcComponent=COMPONENT)
        self._sending = threading.Lock()
        self._newest = session.newest
        self._woken, self._closing = threading.Event(), threading.Event()
        self._unlisten = session.listen(self._see)
        self._threads = [
            threading.Thread(target=self._read, name="ssiam-mavlink-read", daemon=True),
            threading.Thread(target=self._tell, name="ssiam-mavlink-tell", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End both threads and let go of the link. May be called twice."""
        self._unlisten()
        self._closing.set()
        self._woken.set()
        for thread in self._threads:
            thread.join()
        self._link.close()

    def __enter__(self) -> MavlinkCamera:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _see(self, step: Step) -> None:
        self._newest = step
        self._woken.set()

    def _tell(self) -> None:
        """The sender's thread: a heartbeat a second, and the newest step when there is one."""
        beat, told = -math.inf, 0
        while not self._closing.is_set():
            self._woken.wait(max(0.0, beat + _HEARTBEAT - time.monotonic()))
            self._woken.clear()
            if time.monotonic() >= beat + _HEARTBEAT:
                beat = time.monotonic()
                self._send([heartbeat()])
            step = self._newest
            if step is None or step.number == told:
                continue
            told = step.number
            try:
                self._send(self._desk.news(step))
            except Exception as error:
                self._troubles.tell("the MAVLink tracking status", error)

    def _read(self) -> None:
        """The reader's thread: commands as they come, answers as the session gives them."""
        silence = 0.0
        while not self._closing.wait(self._bytes.seconds_left()):
            data = self._link.read(_LOOK)
            self._bytes.take(len(data))
            silence = 0.0 if data else silence + _LOOK
            whole = self._link.datagrams or silence > _PAUSE
            for asked in self._reader.commands(data, whole=whole):
                if self._commands.take(1):
                    self._take(asked)
            try:
                self._send(self._desk.answers())
            except Exception as error:
                self._troubles.tell("the answer to a MAVLink command", error)

    def _take(self, asked: Asked) -> None:
        try:
            self._send(self._desk.handle(asked))
        except Exception as error:
            self._troubles.tell(f"the MAVLink command {asked.command}", error)

    def _send(self, messages: Iterable[Message]) -> None:
        for message in messages:
            with self._sending:
                data = message.pack(self._mavlink)
                self._mavlink.seq = (self._mavlink.seq + 1) % 256
                self._link.write(bytes(data))
