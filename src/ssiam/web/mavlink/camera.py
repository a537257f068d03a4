"""`MavlinkCamera`: a live session as a MAVLink camera component."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from ssiam.errors import ArgumentError
from ssiam.web.mavlink.camera_service import CameraService
from ssiam.web.mavlink.commands import CommandReader, RateLimit, ReceivedCommand
from ssiam.web.mavlink.links import open_link
from ssiam.web.mavlink.messages import COMPONENT, Message, dialect, heartbeat
from ssiam.web.monitoring import ErrorReporter
from ssiam.web.types import Step

if TYPE_CHECKING:
    from ssiam.web.session import Session

_READ_TIMEOUT: Final = 0.02  # seconds to wait for bytes before the session's results are checked
_FRAME_TIMEOUT: Final = 0.2  # seconds of silence that end a frame; radios pause less within one
_HEARTBEAT_INTERVAL: Final = 1.0  # seconds
_BYTES_PER_SECOND: Final = 65536  # limit of reading; the system drops the rest
_COMMANDS_PER_SECOND: Final = 20  # limit of execution; further commands are not answered


class MavlinkCamera:
    """Executes a ground station's tracking commands and sends the tracking status.

    A context manager with two threads, one for reading and one for sending. The session's thread
    waits for neither.

    Parameters
    ----------
    session : Session
    address : str
        See `open_link`.
    system : int
        MAVLink system of this camera, 1 to 255; its component is 100.

    Raises
    ------
    ArgumentError
        The address or the system is invalid.
    MissingExtraError
        pymavlink is not installed; raised when this module is imported.
    """

    def __init__(self, session: Session, address: str, *, system: int = 1) -> None:
        if not 1 <= system <= 255:
            raise ArgumentError(f"MAVLink system {system}: choose one from 1 to 255")
        self._link = open_link(address)
        self._reader = CommandReader(system, COMPONENT)
        self._service = CameraService(session)
        self._errors = ErrorReporter(session.notify)
        self._bytes, self._commands = RateLimit(_BYTES_PER_SECOND), RateLimit(_COMMANDS_PER_SECOND)
        self._mavlink = dialect.MAVLink(None, srcSystem=system, srcComponent=COMPONENT)
        self._send_lock = threading.Lock()
        self._newest = session.newest
        self._wake, self._closing = threading.Event(), threading.Event()
        self._unlisten = session.listen(self._on_step)
        self._threads = [
            threading.Thread(target=self._run_reader, name="ssiam-mavlink-read", daemon=True),
            threading.Thread(target=self._run_sender, name="ssiam-mavlink-send", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End both threads and close the link. May be called twice."""
        self._unlisten()
        self._closing.set()
        self._wake.set()
        for thread in self._threads:
            thread.join()
        self._link.close()

    def __enter__(self) -> MavlinkCamera:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _on_step(self, step: Step) -> None:
        self._newest = step
        self._wake.set()

    def _run_sender(self) -> None:
        """Send a heartbeat every second, and the status after each step."""
        last_beat, last_number = -math.inf, 0
        while not self._closing.is_set():
            self._wake.wait(max(0.0, last_beat + _HEARTBEAT_INTERVAL - time.monotonic()))
            self._wake.clear()
            if time.monotonic() >= last_beat + _HEARTBEAT_INTERVAL:
                last_beat = time.monotonic()
                self._send([heartbeat()])
            step = self._newest
            if step is None or step.number == last_number:
                continue
            last_number = step.number
            try:
                self._send(self._service.status_after(step))
            except Exception as error:
                self._errors.report("the MAVLink tracking status", error)

    def _run_reader(self) -> None:
        """Read and execute commands, and send the session's results."""
        silence = 0.0
        while not self._closing.wait(self._bytes.seconds_left()):
            data = self._link.read(_READ_TIMEOUT)
            self._bytes.take(len(data))
            silence = 0.0 if data else silence + _READ_TIMEOUT
            is_complete = self._link.datagrams or silence > _FRAME_TIMEOUT
            for command in self._reader.commands(data, is_complete=is_complete):
                if self._commands.take(1):
                    self._execute(command)
            try:
                self._send(self._service.results())
            except Exception as error:
                self._errors.report("the answer to a MAVLink command", error)

    def _execute(self, command: ReceivedCommand) -> None:
        try:
            self._send(self._service.handle(command))
        except Exception as error:
            self._errors.report(f"the MAVLink command {command.command}", error)

    def _send(self, messages: Iterable[Message]) -> None:
        for message in messages:
            with self._send_lock:
                data = message.pack(self._mavlink)
                self._mavlink.seq = (self._mavlink.seq + 1) % 256
                self._link.write(bytes(data))
