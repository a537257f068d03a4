"""Folders of exported networks: an .onnx file for each piece, and a manifest."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Final, get_args

from ssiam.errors import WeightsError, one_line
from ssiam.outputs import make_folder, output_error
from ssiam.parsing import parse_json
from ssiam.runtime.network import Precision
from ssiam.unfinished import remove_abandoned, staging_folder

__all__ = [
    "MANIFEST_FILE",
    "OPSET",
    "Manifest",
    "atomic_export",
    "find_export",
    "leftover_exports",
    "package_version",
]

MANIFEST_FILE: Final = "network.json"
_TEMPORARY: Final = ".export-"  # prefix of the folders of unfinished exports
OPSET: Final = 17  # of ONNX; every supported runtime accepts it
_MAX_BYTES: Final = 64 * 1024  # of a manifest; those of all networks have less than 500
_FILE_NAME: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")  # without a suffix


def package_version() -> str:
    """Version of the installed package ssiam."""
    from importlib.metadata import version

    return version("ssiam")


@dataclass(frozen=True)
class Manifest:
    """Description of an exported network, stored as `MANIFEST_FILE` beside its pieces.

    Attributes
    ----------
    name : str
        Name of the tracker for which it was exported.
    network : str
        Name of the network.
    sha256 : str
        Digest of the source file, 64 hexadecimal digits.
    pieces : tuple of str
        Names of the .onnx files without the suffix: template, search, and refine for masks.
    precision : {"f32", "int8"}
        Precision of the search piece; the other pieces are float32.
    opset : int
        Version of the ONNX operator set.
    ssiam : str
        Version of this package that wrote the export.
    """

    name: str
    network: str
    sha256: str
    pieces: tuple[str, ...]
    precision: Precision = "f32"
    opset: int = OPSET
    ssiam: str = field(default_factory=package_version)

    @classmethod
    def read(cls, folder: Path) -> Manifest:
        """The manifest of a folder; `WeightsError` if it is missing or damaged."""
        path = folder / MANIFEST_FILE
        if not path.is_file():
            raise WeightsError(
                f"weights folder {folder} holds no {MANIFEST_FILE}: "
                "give a folder that ssiam weights export has written, or the authors' .pth file"
            )
        try:
            with path.open("rb") as file:
                text = file.read(_MAX_BYTES + 1)
            return cls(**_checked(parse_json(text) if len(text) <= _MAX_BYTES else None))
        except (OSError, ValueError, TypeError) as error:
            reason = error.strerror if isinstance(error, OSError) else one_line(error)
            raise WeightsError(f"{path} is damaged ({reason}): export the network again") from error

    @property
    def cache_key(self) -> str:
        """A text with the values of all fields.

        Names of files in users' cache folders depend on it, so its format must not change.
        """
        fields = ", ".join(f"{name}={value!r}" for name, value in asdict(self).items())
        return f"Exported({fields})"

    def write(self, folder: Path) -> None:
        """Write the manifest to a folder; it must be the last file written there."""
        (folder / MANIFEST_FILE).write_text(json.dumps(asdict(self), indent=2) + "\n")


def _checked(values: Any) -> dict[str, Any]:
    """The fields of a `Manifest`; `ValueError` if a type is wrong or a piece is no file name."""
    if not isinstance(values, dict) or not {each.name for each in fields(Manifest)} >= set(values):
        raise ValueError("other fields")
    pieces = values.get("pieces")
    if not isinstance(pieces, list) or not all(map(_is_file_name, pieces)):
        raise ValueError("pieces")
    for name, value in values.items():
        if name not in ("pieces", "opset") and not isinstance(value, str):
            raise ValueError(name)
    if type(values.get("opset", OPSET)) is not int:
        raise ValueError("opset")
    if values.get("precision", "f32") not in get_args(Precision):
        raise ValueError("precision")
    return values | {"pieces": tuple(pieces)}


def _is_file_name(value: object) -> bool:
    return isinstance(value, str) and _FILE_NAME.fullmatch(value) is not None


@contextmanager
def atomic_export(folder: Path, *, beside: Sequence[str] = ()) -> Iterator[Path]:
    """Replace an exported network after all its new files are complete.

    The files are moved on exit, the manifest last: a folder without a manifest is incomplete. What
    a killed process has left is removed by the next export.

    Parameters
    ----------
    folder : Path
        Created if it does not exist.
    beside : sequence of str
        Further files to move, besides the pieces and the manifest.

    Yields
    ------
    Path
        An empty folder, to which the files are to be written, `Manifest.write` last.

    Raises
    ------
    SinkError
        The folder cannot be written; after any error before the files are moved, the older ones
        are unchanged.
    """
    make_folder(folder)
    try:
        with staging_folder(folder, _TEMPORARY) as temporary:
            yield temporary
            pieces = Manifest.read(temporary).pieces
            files = [*beside, *(f"{piece}.onnx" for piece in pieces), MANIFEST_FILE]
            for file in files:
                with (temporary / file).open("r+b") as written:
                    os.fsync(written.fileno())
            (folder / MANIFEST_FILE).unlink(missing_ok=True)
            for file in files:
                os.replace(temporary / file, folder / file)
    except OSError as error:
        raise output_error(folder, error) from error


def leftover_exports(folder: Path) -> list[Path]:
    """Folders that `atomic_export` is using in `folder`; those of killed processes are removed."""
    return remove_abandoned(sorted(each for each in folder.glob(f"{_TEMPORARY}*") if each.is_dir()))


def find_export(weights: Path) -> Path | None:
    """The folder of an exported network, given that folder or one of its .onnx files, or None."""
    folder = weights.parent if weights.suffix == ".onnx" else weights
    return folder if (folder / MANIFEST_FILE).is_file() else None
