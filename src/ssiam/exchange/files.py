"""Files of exports: opened for writing, with one kind of error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from ssiam.video.outputs import check_output, output_error


@contextmanager
def replaced(path: Path, mode: str) -> Iterator[IO[Any]]:
    """The file `path`, emptied, to be written as text ("w", UTF-8) or bytes ("wb").

    Raises
    ------
    SinkError
        It cannot be written, now or later.
    """
    check_output(path)
    is_text = "b" not in mode
    try:
        with path.open(
            mode, encoding="utf-8" if is_text else None, newline="\n" if is_text else None
        ) as file:
            yield file
    except OSError as error:
        raise output_error(path, error) from error
