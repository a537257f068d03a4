"""`Target`: a reader or socket with valid inputs, and what of it is a fault."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ssiam.errors import SsiamError


@dataclass(frozen=True)
class Target:
    """A reader or socket.

    Attributes
    ----------
    name : str
    seeds : tuple of bytes
        Valid inputs.
    read : callable
        Reads one input; raises `SsiamError` or nothing.
    share : int
        How often it is drawn: slow ones less.
    close : callable
        Ends what the target has started.
    """

    name: str
    seeds: tuple[bytes, ...]
    read: Callable[[bytes], object]
    share: int = 8
    close: Callable[[], None] = lambda: None


def in_file(path: Path, read: Callable[[Path], object]) -> Callable[[bytes], object]:
    path.parent.mkdir(parents=True, exist_ok=True)

    def read_bytes(data: bytes) -> object:
        path.write_bytes(data)
        return read(path)

    return read_bytes


def text(read: Callable[[str], object]) -> Callable[[bytes], object]:
    return lambda data: read(data.decode("utf-8", "surrogateescape"))


def or_value_error(read: Callable[[bytes], object]) -> Callable[[bytes], object]:
    """`ssiam.parsing` is below the errors: its functions raise `ValueError`."""

    def checked(data: bytes) -> None:
        with suppress(ValueError):
            read(data)

    return checked


def latin(read: Callable[[str], object]) -> Callable[[bytes], object]:
    return lambda data: read(data.decode("latin-1"))


def failure(target: Target, data: bytes) -> Exception | None:
    """What a target raises for an input, unless that is a `SsiamError`."""
    try:
        target.read(data)
    except SsiamError:
        return None
    except Exception as error:
        return error
    return None
