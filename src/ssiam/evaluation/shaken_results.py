"""Results on shaken sequences: their folder, and the file in it that tells the shake."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Final

from ssiam.datasets import Dataset, Shake, shaken_dataset
from ssiam.errors import ArgumentError
from ssiam.evaluation.lines import ResultsError, write_lines

_FILE: Final = "shake.json"
_MAX_BYTES: Final = 512
# Folders in that of a tracker.
_IN_A_TRACKERS: Final = ("baseline", "realtime", "unsupervised", "ope")
_NUMBERS: Final = ("strength", "exposure", "readout")


def shaken_folder(out: Path, shake: Shake | None) -> Path:
    """Where in a benchmark's folder the trackers' results lie: ``OUT/shake-white-0.03-seed0``.

    Without a shake they lie in the folder itself.
    """
    return out if shake is None else out / f"shake-{shake.label}"


def write_shake(folder: Path, shake: Shake) -> None:
    """Write ``shake.json``, which `read_shake` reads; `SinkError` if that is not possible."""
    write_lines(folder / _FILE, [json.dumps(asdict(shake))])


def read_shake(results: Path) -> Shake | None:
    """The shake of the results in a folder, be it a tracker's or one of such folders.

    Raises
    ------
    ResultsError
        There is a ``shake.json`` that cannot be read, or that tells no shake.
    """
    folders = [results]
    if any((results / name).is_dir() for name in _IN_A_TRACKERS):
        folders.append(results.resolve().parent)
    for path in (folder / _FILE for folder in folders):
        try:
            if path.is_file():
                return _parsed(path)
        except OSError as error:
            raise ResultsError(f"{path}: cannot be read ({error.strerror or error})") from error
    return None


def shaken_as(results: Path, dataset: Dataset) -> Dataset:
    """The dataset as it was when the results were made; `ResultsError` as `read_shake`."""
    shake = read_shake(results)
    return dataset if shake is None else shaken_dataset(dataset, shake)


def _parsed(path: Path) -> Shake:
    with path.open("rb") as file:
        text = file.read(_MAX_BYTES + 1)
    try:
        values = json.loads(text.decode("ascii")) if len(text) <= _MAX_BYTES else None
        return Shake(**_checked(values))
    except ArgumentError as error:
        raise ResultsError(f"{path}: {error}") from error
    except (ValueError, RecursionError):
        raise ResultsError(
            f"{path}: is not what ssiam bench writes; restore it, or run the benchmark again"
        ) from None


def _checked(values: Any) -> dict[str, Any]:
    """The fields of a `Shake`, each of its type; `ValueError` if they are not."""
    names = {field.name for field in fields(Shake)}
    if not isinstance(values, dict) or set(values) != names:
        raise ValueError("other fields")
    for name, value in values.items():
        wanted = (int, float) if name in _NUMBERS else int if name == "seed" else str
        if not isinstance(value, wanted) or isinstance(value, bool):
            raise ValueError(name)
    return values
