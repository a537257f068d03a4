"""`Skipped`: the damaged annotations of a set, left out and counted, unless there are many."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ssiam.datasets import DatasetError
from ssiam.errors import SsiamError

_log = logging.getLogger(__name__)

# Share of a set's annotations that may be damaged: more is not chance but a wrong layout.
_BEARABLE = 0.1


class Skipped:
    """Counts what could not be read of one set.

    A set of thousands of files should not fail for one of them, and a damaged copy should not
    pass for a whole one: up to a tenth of the annotations are left out with a single warning.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._tried = 0
        self._errors: list[str] = []

    @contextmanager
    def one(self) -> Iterator[None]:
        """Around the reading of one annotation: what it raises of ours is counted."""
        self._tried += 1
        try:
            yield
        except SsiamError as error:
            self._errors.append(str(error))

    def tell(self) -> None:
        """Warn of what was left out; `DatasetError` if that is more than a tenth."""
        count = len(self._errors)
        if not count:
            return
        summary = f"{count} of {self._tried} annotations cannot be read, first: {self._errors[0]}"
        if count > _BEARABLE * self._tried:
            raise DatasetError(f"{self._folder}: {summary}")
        _log.warning("%s: %s; left out", self._folder, summary)
