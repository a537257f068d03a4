"""Where MAVLink's bytes come from and go to: UDP, TCP, a serial port."""

from __future__ import annotations

import os
import selectors
import socket
from contextlib import suppress
from typing import Final, Protocol, TypeAlias

from ssiam.errors import ArgumentError
from ssiam.web.mavlink.ports import SerialPort, StreamLink

_KINDS: Final = "udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or a serial port /dev/NAME,BAUD"
_DATAGRAM: Final = 2048  # bytes; a MAVLink frame has 280 at most
_PEERS: Final = 4  # that are answered at a time
_MARKERS: Final = (0xFD, 0xFE)  # the first byte of a frame, versions 2 and 1
_BAUD: Final = 115200
_CONNECT_TIMEOUT: Final = 1.0  # seconds

_Address: TypeAlias = "tuple[str, int] | tuple[str, int, int, int] | tuple[int, bytes]"


class Link(Protocol):
    """Bytes both ways; `read` is called by one thread, `write` by any.

    Attributes
    ----------
    datagrams : bool
        Whether what one `read` gives is whole: a frame is never continued by the next.
    """

    datagrams: bool

    def read(self, seconds: float) -> bytes:
        """What has come; b"" if nothing does in that time."""

    def write(self, data: bytes) -> None:
        """Send at once, or not at all where that would have to wait."""

    def close(self) -> None:
        """Let go of the socket or port."""


def open_link(address: str) -> Link:
    """The link that `address` names, in the words of pymavlink.

    ``udpout:HOST:PORT`` sends there, ``udpin:HOST:PORT`` waits there for others (also written
    ``udp:``), ``tcp:HOST:PORT`` connects, and goes on trying; all else is a serial port, with its
    baud rate behind a comma (115200).

    Raises
    ------
    ArgumentError
        There is no such kind of address, the host has no address, the port is taken or absent.
    """
    kind, _, place = address.partition(":")
    if kind == "udpout":
        return _UdpOut(address, place)
    if kind in ("udpin", "udp"):
        return _UdpIn(address, place)
    if kind == "tcp":
        target = _host_and_port(address, place)
        return StreamLink(address, lambda: _connected(target))
    device, _, baud = address.partition(",")
    if not device or not os.path.exists(device):
        raise ArgumentError(f"MAVLink address {address!r}: use {_KINDS}")
    return _serial(address, device, baud or str(_BAUD))


class _UdpOut:
    """One peer, whose address is known; nobody else is heard."""

    datagrams = True

    def __init__(self, address: str, place: str) -> None:
        family, target = _resolved(address, place)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.connect(target)
        except OSError as error:
            self._socket.close()
            raise _unusable(address, error) from error
        self._waiting = _watched(self._socket)

    def read(self, seconds: float) -> bytes:
        # Nobody listens over there: the system says so on the next call, and it does not matter.
        with suppress(OSError):
            if self._waiting.select(seconds):
                return self._socket.recv(_DATAGRAM)
        return b""

    def write(self, data: bytes) -> None:
        with suppress(OSError):
            self._socket.send(data)

    def close(self) -> None:
        self._waiting.close()
        self._socket.close()


class _UdpIn:
    """Whoever sends to this port is answered: the last few of them."""

    datagrams = True

    def __init__(self, address: str, place: str) -> None:
        family, here = _resolved(address, place)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self._socket.bind(here)
        except OSError as error:
            self._socket.close()
            raise _unusable(address, error) from error
        self._waiting = _watched(self._socket)
        self._peers: tuple[_Address, ...] = ()

    def read(self, seconds: float) -> bytes:
        with suppress(OSError):
            if self._waiting.select(seconds):
                data, peer = self._socket.recvfrom(_DATAGRAM)
                if data[:1] and data[0] in _MARKERS:
                    self._remember(peer)
                return data
        return b""

    def write(self, data: bytes) -> None:
        for peer in self._peers:
            with suppress(OSError):
                self._socket.sendto(data, peer)

    def close(self) -> None:
        self._waiting.close()
        self._socket.close()

    def _remember(self, peer: _Address) -> None:
        others = (each for each in self._peers if each != peer)
        self._peers = (peer, *others)[:_PEERS]


def _watched(sock: socket.socket) -> selectors.BaseSelector:
    sock.setblocking(False)
    selector = selectors.DefaultSelector()
    selector.register(sock, selectors.EVENT_READ)
    return selector


def _host_and_port(address: str, place: str) -> tuple[str, int]:
    host, _, port = place.rpartition(":")
    if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise ArgumentError(f"MAVLink address {address!r}: give a host and a port from 1 to 65535")
    return host.strip("[]"), int(port)


def _resolved(address: str, place: str) -> tuple[socket.AddressFamily, _Address]:
    host, port = _host_and_port(address, place)
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise _unusable(address, error) from error
    return found[0][0], found[0][4]


def _connected(target: tuple[str, int]) -> socket.socket:
    port = socket.create_connection(target, timeout=_CONNECT_TIMEOUT)
    port.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    port.setblocking(False)
    return port


def _serial(address: str, device: str, baud: str) -> StreamLink:
    if not baud.isascii() or not baud.isdigit():
        raise ArgumentError(f"MAVLink address {address!r}: {baud!r} is no baud rate")
    try:
        SerialPort(device, int(baud)).close()
    except OSError as error:
        raise _unusable(address, error) from error
    return StreamLink(address, lambda: SerialPort(device, int(baud)))


def _unusable(address: str, error: OSError | UnicodeError) -> ArgumentError:
    why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return ArgumentError(f"MAVLink address {address!r} cannot be used: {why}")
