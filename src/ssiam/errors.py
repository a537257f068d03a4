"""The exceptions of ssiam: everything that it raises on purpose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, TypeVar

_LONGEST_TEXT: Final = 200  # characters of another package's message


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


class TrackingError(SsiamError):
    """A tracker that failed on a frame; it may go on with the next one."""


class IncompleteError(SsiamError):
    """Work that ran to its end with parts missing; what was done is kept."""


class DatasetError(SsiamError):
    """A dataset that is missing, damaged or of another layout; the text names file or folder."""


class UnknownSequenceError(DatasetError, KeyError):
    """A sequence name that a dataset does not have."""

    __str__ = Exception.__str__  # that of KeyError adds quotes


class AnnotationsError(SsiamError):
    """Results that cannot be read as annotations; the text names the file and often the line."""


Choice = TypeVar("Choice", bound=str)


def one_line(error: BaseException) -> str:
    """An error as one line for people: the text of a `SsiamError`, else its type and text."""
    text = " ".join(str(error).split())
    if isinstance(error, SsiamError):
        return text
    if len(text) > _LONGEST_TEXT:
        text = f"{text[:_LONGEST_TEXT]}..."
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def check_choice(kind: str, value: str, known: Sequence[Choice]) -> Choice:
    """`value`, if it is one of the `known` names; else an `ArgumentError` that lists them."""
    for name in known:
        if name == value:
            return name
    raise ArgumentError(f"unknown {kind} {value!r}: choose from {', '.join(known)}")
