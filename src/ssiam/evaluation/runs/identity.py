"""`Identity`: the weights and the runtime behind a tracker's results, recorded in ``run.json``.

A tracker's folder holds the results of one identity. Its name has the runtime options that are not
the defaults (`Entry.label`), and ``run.json`` in it the weights. Results of other weights go to a
folder of their own, ``LABEL-weights=DIGITS``.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

from ssiam.evaluation.runs.entries import Entry
from ssiam.evaluation.runs.result_files import ResultsError, write_lines
from ssiam.parsing import parse_json
from ssiam.runtime.files import weights_sha256
from ssiam.trackers import has_networks, weights_path

RECORD: Final = "run.json"
_MAX_BYTES: Final = 1024
_DIGITS: Final = 12  # of the weights' SHA-256, in the name of a folder


@dataclass(frozen=True)
class Identity:
    """What the numbers of a run depend on, besides the sequence and the label's settings.

    Attributes
    ----------
    weights_sha256 : str or None
        Digest of the tracker's weights, 64 hexadecimal digits; None for trackers without weights,
        and while the weights are missing.
    runtime, device, precision : str
        As for `RuntimeOptions`.
    threads : int
    """

    weights_sha256: str | None
    runtime: str
    device: str
    precision: str
    threads: int

    @classmethod
    def of(cls, entry: Entry) -> Identity:
        """The identity of an entry, with the weights as they are on disk now."""
        path = weights_path(entry.tracker, entry.weights)
        options = entry.options
        return cls(
            None if path is None else weights_sha256(path, options.runtime),
            options.runtime,
            options.resolved_device,
            options.precision,
            options.threads,
        )

    def made(self, results: Path, entry: Entry) -> bool:
        """Whether the results in a tracker's folder are of this identity.

        Those without a record are, if the tracker has no networks: earlier versions wrote none.
        """
        earlier = read_identity(results)
        if earlier is None:
            return not has_networks(entry.tracker)
        return earlier == self

    def claim(self, results: Path) -> None:
        """Record the identity in a tracker's folder, before the first result is written to it.

        Raises
        ------
        ResultsError
            The folder has results of another identity, or its record is damaged.
        SinkError
            The record cannot be written.
        """
        earlier = read_identity(results)
        if earlier is None:
            write_lines(results / RECORD, [json.dumps(asdict(self))])
        elif earlier != self:
            theirs, ours = asdict(earlier), asdict(self)
            name = next(name for name in ours if ours[name] != theirs[name])
            raise ResultsError(
                f"{results}: holds results of {name} {theirs[name]}, not {ours[name]}; "
                "give another --out"
            )


def label_in(folder: Path, entry: Entry, identity: Identity) -> str:
    """Name of the entry's results folder in `folder`.

    Parameters
    ----------
    folder : Path
        Folder of all results.
    entry : Entry
    identity : Identity

    Returns
    -------
    str
        `Entry.label`, followed by the first digits of the weights' SHA-256 if the folder of that
        name has results of other weights, or has results without a record of their weights.

    Raises
    ------
    ResultsError
        A ``run.json`` is damaged.
    """
    label, digest = entry.label, identity.weights_sha256
    earlier = read_identity(folder / label)
    if digest is None or earlier == identity:
        return label
    is_free = earlier is None and not any((folder / label).glob("*/*/*_001.txt"))
    return label if is_free else f"{label}-weights={digest[:_DIGITS]}"


def read_identity(results: Path) -> Identity | None:
    """The identity of the results in a tracker's folder; None without a ``run.json``.

    Raises `ResultsError` if the file is damaged.
    """
    path = results / RECORD
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            text = file.read(_MAX_BYTES + 1)
        return Identity(**_checked(parse_json(text.decode("ascii"))))
    except OSError as error:
        raise ResultsError(f"{path}: cannot be read ({error.strerror or error})") from error
    except ValueError:
        raise ResultsError(
            f"{path}: not as written by ssiam bench; restore it, or delete the folder to run the "
            "tracker again"
        ) from None


def _checked(values: Any) -> dict[str, Any]:
    """The fields of an `Identity`; `ValueError` if their names or types are wrong."""
    if not isinstance(values, dict) or set(values) != {each.name for each in fields(Identity)}:
        raise ValueError("other fields")
    for name, value in values.items():
        is_right = type(value) is (int if name == "threads" else str)
        if not is_right and not (name == "weights_sha256" and value is None):
            raise ValueError(name)
    return values
