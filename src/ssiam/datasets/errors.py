"""The exceptions of the datasets' readers."""

from __future__ import annotations

from ssiam.errors import SsiamError


class DatasetError(SsiamError):
    """A dataset that is not where or what it should be; the text names the file or folder."""


class UnknownSequenceError(DatasetError, KeyError):
    """A name that no sequence of a dataset has."""

    # KeyError would show the line in quotes.
    __str__ = Exception.__str__
