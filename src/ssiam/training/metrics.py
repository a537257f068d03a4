"""Metrics of a run: a CSV file, and TensorBoard if it is installed."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, Final

from ssiam.errors import SinkError
from ssiam.outputs import atomic_write, output_error
from ssiam.parsing import is_number_word

__all__ = ["METRICS", "Metrics"]

METRICS: Final = "metrics.csv"
_COLUMNS: Final = ("step", "name", "value")
_MAX_BYTES: Final = 1 << 27  # of a run's metrics; a million steps have less than a third
_MAX_DIGITS: Final = 18  # of a step


class Metrics:
    """Writes values by step and name, one per row.

    Parameters
    ----------
    folder : Path
    step : int
        First step that will be written. Existing rows of this and later steps, which a killed run
        has left, are removed.

    Raises
    ------
    SinkError
        The file cannot be written.
    """

    def __init__(self, folder: Path, step: int = 0) -> None:
        self._path = path = folder / METRICS
        try:
            earlier = _rows_before(path, step)
            with atomic_write(path, "w", hidden=True) as file:
                csv.writer(file).writerows((_COLUMNS, *earlier))
            self._file = path.open("a", newline="", encoding="utf-8")
            self._board = _open_board(folder, step)
        except OSError as error:
            raise output_error(path, error) from error
        self._rows = csv.writer(self._file)

    def write(self, step: int, values: Mapping[str, float]) -> None:
        """Write the values of a step and flush the file; `SinkError` if that fails."""
        try:
            for name, value in values.items():
                self._rows.writerow((step, name, f"{value:.6g}"))
                if self._board is not None:
                    self._board.add_scalar(name, value, step)
            self._file.flush()
        except OSError as error:
            raise output_error(self._path, error) from error

    def __enter__(self) -> Metrics:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        # After an error of `write`, closing fails again with what is still in the buffers.
        with suppress(SinkError) if exc_type is not None else nullcontext():
            self._close()

    def _close(self) -> None:
        try:
            self._file.close()
            if self._board is not None:
                self._board.close()
        except OSError as error:
            raise output_error(self._path, error) from error


def _rows_before(path: Path, step: int) -> list[list[str]]:
    """The rows of earlier steps, without the header and damaged rows."""
    if not path.is_file():
        return []
    size = path.stat().st_size
    if size > _MAX_BYTES:
        raise SinkError(f"{path}: has {size} bytes, more than the metrics of a run; move it away")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    rows = [words for line in lines if len(words := line.split(",")) == len(_COLUMNS)]
    return [row for row in rows if _is_before(row[0], step)]


def _is_before(word: str, step: int) -> bool:
    return is_number_word(word) and len(word) <= _MAX_DIGITS and int(word) < step


def _open_board(folder: Path, step: int) -> Any:
    if find_spec("tensorboard") is None:
        return None
    from torch.utils.tensorboard import SummaryWriter

    return SummaryWriter(str(folder / "tensorboard"), purge_step=step)
