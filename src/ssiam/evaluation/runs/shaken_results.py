"""Results on sequences with synthetic shake: their folder, and ``shake.json`` in it."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Final

from ssiam.datasets import Dataset, Shake, shaken_dataset
from ssiam.errors import ArgumentError
from ssiam.evaluation.runs.result_files import ResultsError, write_lines
from ssiam.parsing import parse_json

_FILE: Final = "shake.json"
_MAX_BYTES: Final = 512
# Subfolders of a tracker's results.
_TRACKER_SUBFOLDERS: Final = ("baseline", "realtime", "unsupervised", "ope")
_NUMBERS: Final = ("strength", "exposure", "readout")


def shaken_folder(out: Path, shake: Shake | None) -> Path:
    """Folder of all results: ``OUT/shake-white-0.03-seed0``, or ``OUT`` without a shake."""
    return out if shake is None else out / f"shake-{shake.label}"


def write_shake(folder: Path, shake: Shake) -> None:
    """Write ``shake.json`` for `read_shake`; `SinkError` if it cannot be written."""
    write_lines(folder / _FILE, [json.dumps(asdict(shake))])


def read_shake(results: Path) -> Shake | None:
    """The shake of the results in a folder: a tracker's folder, or the one above it.

    Returns
    -------
    Shake or None
        None if there is no ``shake.json``.

    Raises
    ------
    ResultsError
        ``shake.json`` cannot be read, or does not describe a shake.
    """
    folders = [results]
    if any((results / name).is_dir() for name in _TRACKER_SUBFOLDERS):
        folders.append(results.resolve().parent)
    for path in (folder / _FILE for folder in folders):
        try:
            if path.is_file():
                return _parsed(path)
        except OSError as error:
            raise ResultsError(f"{path}: cannot be read ({error.strerror or error})") from error
    return None


def shaken_as(results: Path, dataset: Dataset) -> Dataset:
    """The dataset with the shake of the results; `ResultsError` as `read_shake`."""
    shake = read_shake(results)
    return dataset if shake is None else shaken_dataset(dataset, shake)


def _parsed(path: Path) -> Shake:
    with path.open("rb") as file:
        text = file.read(_MAX_BYTES + 1)
    try:
        values = parse_json(text.decode("ascii")) if len(text) <= _MAX_BYTES else None
        return Shake(**_checked(values))
    except ArgumentError as error:
        raise ResultsError(f"{path}: {error}") from error
    except ValueError:
        raise ResultsError(
            f"{path}: not as written by ssiam bench; restore it, or run the benchmark again"
        ) from None


def _checked(values: Any) -> dict[str, Any]:
    """The fields of a `Shake`; `ValueError` if their names or types are wrong."""
    names = {field.name for field in fields(Shake)}
    if not isinstance(values, dict) or set(values) != names:
        raise ValueError("not the fields of a shake")
    for name, value in values.items():
        wanted = (int, float) if name in _NUMBERS else int if name == "seed" else str
        if not isinstance(value, wanted) or isinstance(value, bool):
            raise ValueError(name)
    return values
