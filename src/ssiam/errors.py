"""The exceptions of ssiam: everything that it raises on purpose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar


class SsiamError(Exception):
    """Base of all exceptions of this package; its text is one line written for the user."""


class ArgumentError(SsiamError, ValueError):
    """A value that cannot be used: an empty box, an unknown name, a negative limit."""


class WeightsError(SsiamError):
    """Weights that are missing, damaged or made for another network."""


class SourceError(SsiamError):
    """A video source that cannot be opened, or that is not what its name promises."""


class StreamError(SsiamError):
    """A source that broke off after it had delivered frames; what came before is valid."""


class SinkError(SsiamError):
    """An output that cannot be written."""


class FrameSizeError(SsiamError):
    """A frame whose size differs from the frames before it."""


class CopyError(SsiamError, TypeError):
    """An object that cannot be copied, or not be pickled."""


class MissingExtraError(SsiamError):
    """A feature whose optional dependency is not installed."""


Choice = TypeVar("Choice", bound=str)


def check_choice(kind: str, value: str, known: Sequence[Choice]) -> Choice:
    """`value`, if it is one of the `known` names; else an `ArgumentError` that lists them."""
    for name in known:
        if name == value:
            return name
    raise ArgumentError(f"unknown {kind} {value!r}: choose from {', '.join(known)}")
