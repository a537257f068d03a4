"""`StreamLink`: a connection that comes back after it was lost; serial ports."""

from __future__ import annotations

import errno
import logging
import os
import selectors
import sys
import threading
import time
from collections.abc import Callable
from typing import Final, Protocol

from ssiam.errors import ArgumentError

_log = logging.getLogger(__name__)

_RETRY: Final = 1.0  # seconds between two attempts to connect
_PIECE: Final = 2048  # bytes


class Port(Protocol):
    """What a stream is made of: a TCP socket, a `SerialPort`. None of it waits."""

    def recv(self, size: int, /) -> bytes:
        """Up to `size` bytes; b"" at the end."""

    def send(self, data: bytes, /) -> int:
        """How many of the bytes went."""

    def fileno(self) -> int:
        """The descriptor."""

    def close(self) -> None:
        """Let go."""


class StreamLink:
    """A `Link` over a connection: opened when it is needed, and again after it broke.

    Parameters
    ----------
    name : str
        As messages call it.
    connect : callable
        Gives an open `Port`, or raises OSError.
    """

    datagrams = False

    def __init__(self, name: str, connect: Callable[[], Port]) -> None:
        self._name, self._connect = name, connect
        self._lock = threading.Lock()
        self._port: Port | None = None
        self._selector = selectors.DefaultSelector()
        self._rest = b""
        self._next_try = 0.0
        self._complained = False

    def read(self, seconds: float) -> bytes:
        """What has come; b"" if nothing does in that time, or nobody is there."""
        port = self._port or self._connected()
        if port is None:
            time.sleep(seconds)
            return b""
        try:
            if not self._selector.select(seconds):
                return b""
            data = port.recv(_PIECE)
        except BlockingIOError:
            return b""
        except OSError as error:
            self._lose(port, str(error))
            return b""
        if not data:
            self._lose(port, "the other side ended it")
        return data

    def write(self, data: bytes) -> None:
        """Send at once, or drop: a frame of which a part went is finished before the next one."""
        with self._lock:
            if self._port is None:
                return
            try:
                if self._rest:
                    self._rest = self._rest[self._port.send(self._rest) :]
                if not self._rest:
                    self._rest = data[self._port.send(data) :]
            except OSError:
                # Full, or broken: the reader finds out which.
                return

    def close(self) -> None:
        """Let go of the connection."""
        with self._lock:
            port, self._port = self._port, None
            if port is not None:
                port.close()
        self._selector.close()

    def _connected(self) -> Port | None:
        if time.monotonic() < self._next_try:
            return None
        try:
            port = self._connect()
        except OSError as error:
            self._next_try = time.monotonic() + _RETRY
            if not self._complained:
                self._complained = True
                _log.warning("%s: %s; trying again", self._name, error)
            return None
        self._complained = False
        self._selector.register(port.fileno(), selectors.EVENT_READ)
        with self._lock:
            self._rest, self._port = b"", port
        return port

    def _lose(self, port: Port, why: str) -> None:
        _log.warning("%s is gone: %s; trying again", self._name, why)
        self._next_try = time.monotonic() + _RETRY
        self._selector.unregister(port.fileno())
        with self._lock:
            self._port = None
            port.close()


class SerialPort:
    """A serial port of Linux or macOS: raw bytes, 8N1, no flow control.

    Raises
    ------
    OSError
        It cannot be opened, or is no serial port.
    ArgumentError
        The system does not know the baud rate, or is Windows.
    """

    def __init__(self, device: str, baud: int) -> None:
        self._descriptor = -1
        if sys.platform == "win32":
            raise ArgumentError(f"{device}: serial ports need Linux or macOS; use UDP or TCP")
        self._descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            _set_raw(self._descriptor, device, baud)
        except (ArgumentError, OSError):
            self.close()
            raise

    def recv(self, size: int, /) -> bytes:
        """Up to `size` bytes; b"" once the device is gone."""
        return os.read(self._descriptor, size)

    def send(self, data: bytes, /) -> int:
        """How many of the bytes went."""
        return os.write(self._descriptor, data)

    def fileno(self) -> int:
        """The descriptor."""
        return self._descriptor

    def close(self) -> None:
        """Let go."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _set_raw(descriptor: int, device: str, baud: int) -> None:
    import termios
    import tty

    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise ArgumentError(f"{device}: this system has no baud rate {baud}; 57600 or 115200?")
    try:
        tty.setraw(descriptor, termios.TCSANOW)
        mode = termios.tcgetattr(descriptor)
        mode[2] |= termios.CLOCAL | termios.CREAD
        mode[4] = mode[5] = speed
        termios.tcsetattr(descriptor, termios.TCSANOW, mode)
    except termios.error as error:
        raise OSError(errno.ENOTTY, "it is no serial port") from error
