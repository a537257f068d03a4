"""Links that carry MAVLink: UDP, TCP, serial ports."""

from __future__ import annotations

import errno
import logging
import os
import selectors
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final, Protocol, TypeAlias

from ssiam.addresses import display_name
from ssiam.errors import ArgumentError
from ssiam.parsing import is_number_word

_log = logging.getLogger(__name__)

_KINDS: Final = "udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or a serial port /dev/NAME,BAUD"
_READ_BYTES: Final = 2048  # of one read; a MAVLink frame has 280 at most
_MAX_PEERS: Final = 4  # answered at a time
_START_BYTES: Final = (0xFD, 0xFE)  # of a frame, versions 2 and 1
_DEFAULT_BAUD: Final = 115200
_CONNECT_TIMEOUT: Final = 1.0  # seconds
_RETRY_INTERVAL: Final = 1.0  # seconds between two attempts to connect

_SocketAddress: TypeAlias = "tuple[str, int] | tuple[str, int, int, int] | tuple[int, bytes]"


class Link(Protocol):
    """Bytes in both directions; `read` must be called on one thread, `write` on any.

    Attributes
    ----------
    datagrams : bool
        Whether each `read` returns complete frames; no frame continues in the next `read`.
    """

    datagrams: bool

    def read(self, seconds: float) -> bytes:
        """Return the bytes that have arrived; b"" if none arrives within `seconds`."""

    def write(self, data: bytes) -> None:
        """Send without blocking; drop the data if that is impossible."""

    def close(self) -> None:
        """Close the socket or port."""


def open_link(address: str) -> Link:
    """Open a link.

    Parameters
    ----------
    address : str
        In pymavlink's syntax. ``udpout:HOST:PORT`` sends to that address; ``udpin:HOST:PORT``
        (or ``udp:``) listens there; ``tcp:HOST:PORT`` connects, with any number of attempts;
        anything else is a serial port, with its baud rate after a comma (default 115200).

    Raises
    ------
    ArgumentError
        The address is invalid, the host is unknown, or the port is in use or missing.
    """
    kind, _, host_and_port = address.partition(":")
    if kind == "udpout":
        return _UdpOut(address, host_and_port)
    if kind in ("udpin", "udp"):
        return _UdpIn(address, host_and_port)
    if kind == "tcp":
        target = _split(address, host_and_port)
        return StreamLink(address, lambda: _connect_tcp(target))
    device, _, baud = address.partition(",")
    if not device or not os.path.exists(device):
        raise ArgumentError(f"MAVLink address {display_name(address)!r}: use {_KINDS}")
    return _open_serial(address, device, baud or str(_DEFAULT_BAUD))


class _UdpOut:
    """A UDP link to one peer; packets of others are ignored."""

    datagrams = True

    def __init__(self, address: str, host_and_port: str) -> None:
        family, target = _resolve(address, host_and_port)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.connect(target)
        except OSError as error:
            self._socket.close()
            raise _unusable(address, error) from error
        self._selector = _selector_of(self._socket)

    def read(self, seconds: float) -> bytes:
        # If no program listens at the peer, the next call raises an error.
        with suppress(OSError):
            if self._selector.select(seconds):
                return self._socket.recv(_READ_BYTES)
        return b""

    def write(self, data: bytes) -> None:
        with suppress(OSError):
            self._socket.send(data)

    def close(self) -> None:
        self._selector.close()
        self._socket.close()


class _UdpIn:
    """A UDP link that answers the peers that last sent to its port."""

    datagrams = True

    def __init__(self, address: str, host_and_port: str) -> None:
        family, own_address = _resolve(address, host_and_port)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.bind(own_address)
        except OSError as error:
            self._socket.close()
            raise _unusable(address, error) from error
        self._selector = _selector_of(self._socket)
        self._peers: tuple[_SocketAddress, ...] = ()

    def read(self, seconds: float) -> bytes:
        with suppress(OSError):
            if self._selector.select(seconds):
                data, peer = self._socket.recvfrom(_READ_BYTES)
                if data[:1] and data[0] in _START_BYTES:
                    self._remember(peer)
                return data
        return b""

    def write(self, data: bytes) -> None:
        for peer in self._peers:
            with suppress(OSError):
                self._socket.sendto(data, peer)

    def close(self) -> None:
        self._selector.close()
        self._socket.close()

    def _remember(self, peer: _SocketAddress) -> None:
        others = (each for each in self._peers if each != peer)
        self._peers = (peer, *others)[:_MAX_PEERS]


class Port(Protocol):
    """A non-blocking byte stream: a TCP socket or a `SerialPort`."""

    def recv(self, size: int, /) -> bytes:
        """Up to `size` bytes; b"" at the end."""

    def send(self, data: bytes, /) -> int:
        """Send; returns how many of the bytes were accepted."""

    def fileno(self) -> int:
        """The file descriptor."""

    def close(self) -> None:
        """Close the stream."""


class StreamLink:
    """A `Link` over a byte stream, which is opened when needed and again after it is lost.

    Parameters
    ----------
    name : str
        For messages.
    connect : callable
        Returns an open `Port`, or raises OSError.
    """

    datagrams = False

    def __init__(self, name: str, connect: Callable[[], Port]) -> None:
        self._name, self._connect = display_name(name), connect
        self._lock = threading.Lock()
        self._port: Port | None = None
        self._selector = selectors.DefaultSelector()
        self._unsent = b""  # rest of a partly sent frame
        self._next_attempt = 0.0
        self._failure_logged = False

    def read(self, seconds: float) -> bytes:
        """Return the bytes that have arrived; b"" without a peer, or if none arrives in time."""
        port = self._port or self._open_port()
        if port is None:
            time.sleep(seconds)
            return b""
        try:
            if not self._selector.select(seconds):
                return b""
            data = port.recv(_READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            self._drop_port(port, str(error))
            return b""
        if not data:
            self._drop_port(port, "closed by the peer")
        return data

    def write(self, data: bytes) -> None:
        """Send without blocking, or drop the frame; a partly sent frame is completed first."""
        with self._lock:
            if self._port is None:
                return
            try:
                if self._unsent:
                    self._unsent = self._unsent[self._port.send(self._unsent) :]
                if not self._unsent:
                    self._unsent = data[self._port.send(data) :]
            except OSError:
                # The buffer is full, or the connection broke, which `read` notices.
                return

    def close(self) -> None:
        """Close the connection."""
        with self._lock:
            port, self._port = self._port, None
            if port is not None:
                port.close()
        self._selector.close()

    def _open_port(self) -> Port | None:
        if time.monotonic() < self._next_attempt:
            return None
        try:
            port = self._connect()
        except OSError as error:
            self._next_attempt = time.monotonic() + _RETRY_INTERVAL
            if not self._failure_logged:
                self._failure_logged = True
                _log.warning("%s: %s; trying to connect", self._name, error)
            return None
        self._failure_logged = False
        self._selector.register(port.fileno(), selectors.EVENT_READ)
        with self._lock:
            self._unsent, self._port = b"", port
        return port

    def _drop_port(self, port: Port, reason: str) -> None:
        _log.warning("%s: connection lost (%s); trying to reconnect", self._name, reason)
        self._next_attempt = time.monotonic() + _RETRY_INTERVAL
        self._selector.unregister(port.fileno())
        with self._lock:
            self._port = None
            port.close()


class SerialPort:
    """A serial port of Linux or macOS: raw bytes, 8N1, no flow control.

    Raises
    ------
    OSError
        It cannot be opened, or is not a serial port.
    ArgumentError
        The baud rate is not supported, or the system is Windows.
    """

    def __init__(self, device: str, baud: int) -> None:
        self._descriptor = -1
        if sys.platform == "win32":
            raise ArgumentError(f"{device}: serial ports need Linux or macOS; use UDP or TCP")
        self._descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            _configure_raw(self._descriptor, device, baud)
        except (ArgumentError, OSError):
            self.close()
            raise

    def recv(self, size: int, /) -> bytes:
        """Up to `size` bytes; b"" when the device was unplugged."""
        return os.read(self._descriptor, size)

    def send(self, data: bytes, /) -> int:
        """Send; returns how many of the bytes were accepted."""
        return os.write(self._descriptor, data)

    def fileno(self) -> int:
        """The file descriptor."""
        return self._descriptor

    def close(self) -> None:
        """Close the port."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _open_serial(address: str, device: str, baud: str) -> StreamLink:
    if not is_number_word(baud):
        raise ArgumentError(
            f"MAVLink address {display_name(address)!r}: {baud!r} is not a baud rate; use 57600"
        )
    try:
        SerialPort(device, int(baud)).close()
    except OSError as error:
        raise _unusable(address, error) from error
    return StreamLink(address, lambda: SerialPort(device, int(baud)))


def _configure_raw(descriptor: int, device: str, baud: int) -> None:
    import termios
    import tty

    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise ArgumentError(f"{device}: baud rate {baud} is not supported; try 57600 or 115200")
    try:
        tty.setraw(descriptor, termios.TCSANOW)
        mode = termios.tcgetattr(descriptor)
        mode[2] |= termios.CLOCAL | termios.CREAD
        mode[4] = mode[5] = speed
        termios.tcsetattr(descriptor, termios.TCSANOW, mode)
    except termios.error as error:
        raise OSError(errno.ENOTTY, "not a serial port") from error


def _connect_tcp(target: tuple[str, int]) -> socket.socket:
    port = socket.create_connection(target, timeout=_CONNECT_TIMEOUT)
    port.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    port.setblocking(False)
    return port


def _selector_of(sock: socket.socket) -> selectors.BaseSelector:
    sock.setblocking(False)
    selector = selectors.DefaultSelector()
    selector.register(sock, selectors.EVENT_READ)
    return selector


def _split(address: str, host_and_port: str) -> tuple[str, int]:
    host, _, port = host_and_port.rpartition(":")
    if not host or not is_number_word(port) or not 0 < int(port) < 65536:
        raise ArgumentError(
            f"MAVLink address {display_name(address)!r}: give a host and a port from 1 to 65535"
        )
    return host.strip("[]"), int(port)


def _resolve(address: str, host_and_port: str) -> tuple[socket.AddressFamily, _SocketAddress]:
    host, port = _split(address, host_and_port)
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise _unusable(address, error) from error
    return found[0][0], found[0][4]


def _unusable(address: str, error: OSError | UnicodeError) -> ArgumentError:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return ArgumentError(f"MAVLink address {display_name(address)!r} cannot be used: {reason}")
