"""The exceptions that ssiam raises intentionally."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, TypeVar

_MAX_LENGTH: Final = 200  # characters of another package's message


class SsiamError(Exception):
    """Base of all exceptions of this package; the text is one line for the user."""


class ArgumentError(SsiamError, ValueError):
    """An invalid value: an empty box, an unknown name, a negative limit."""


class WeightsError(SsiamError):
    """Weights that are missing, damaged or for another network."""


class SourceError(SsiamError):
    """A video source that cannot be opened, or whose content does not fit its name."""


class StreamError(SsiamError):
    """A source that ended too early; the frames that it returned are valid."""


class SinkError(SsiamError):
    """An output that cannot be written."""


class FrameSizeError(SsiamError):
    """A frame whose size differs from that of the previous frames."""


class CopyError(SsiamError, TypeError):
    """An object that cannot be copied or pickled."""


class MissingExtraError(SsiamError):
    """A feature whose optional dependency is not installed."""


class TrackingError(SsiamError):
    """A tracker that failed on a frame; it may continue with the next one."""


class ContractError(SsiamError, AssertionError):
    """A tracker that does not do what `ssiam.testing` expects of every tracker."""


class IncompleteError(SsiamError):
    """Work that finished with parts missing; the results are kept."""


class DatasetError(SsiamError):
    """A dataset that is missing, damaged or of another layout; the text names the path."""


class UnknownSequenceError(DatasetError, KeyError):
    """A sequence name that a dataset does not have."""

    __str__ = Exception.__str__  # KeyError.__str__ adds quotes


class AnnotationsError(SsiamError):
    """Results that cannot be read as annotations; the text names the file and often the line."""


Choice = TypeVar("Choice", bound=str)


def one_line(error: BaseException) -> str:
    """Format an error as one line: the text of a `SsiamError`, else type and text."""
    text = " ".join(str(error).split())
    if isinstance(error, SsiamError):
        return text
    if len(text) > _MAX_LENGTH:
        text = f"{text[:_MAX_LENGTH]}..."
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def check_choice(kind: str, value: str, known: Sequence[Choice]) -> Choice:
    """Return `value` if it is one of the `known` names; else raise an `ArgumentError`."""
    for name in known:
        if name == value:
            return name
    same = similar_names(value, known)
    if same:
        raise ArgumentError(f"unknown {kind} {value!r}: did you mean {' or '.join(same)}?")
    raise ArgumentError(f"unknown {kind} {value!r}: choose from {', '.join(known)}")


def similar_names(name: object, known: Iterable[Choice]) -> list[Choice]:
    """The known names that differ from a name only in case and punctuation."""
    return [each for each in known if _letters(each) == _letters(name)]


def _letters(name: object) -> str:
    return "".join(letter for letter in str(name).casefold() if letter.isalnum())
