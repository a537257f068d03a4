"""Folders of exported networks: an .onnx file for each piece, and a record of what they are."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Final

from ssiam.errors import WeightsError
from ssiam.runtime.network import Precision

__all__ = ["OPSET", "RECORD", "VERSION", "Exported", "export_folder", "put"]

RECORD: Final = "network.json"
OPSET: Final = 17  # of ONNX: what all runtimes that are supported here take
VERSION: Final = version("ssiam")


@dataclass(frozen=True)
class Exported:
    """What an exported network is; stored as `RECORD` beside its pieces.

    Attributes
    ----------
    name : str
        Under which it was exported, a tracker's.
    network : str
    sha256 : str
        Digest of the file that it was made from, 64 hexadecimal digits.
    pieces : tuple of str
        Names of the .onnx files without the suffix: template, search, and refine for masks.
    precision : {"f32", "int8"}
        Of `search`; the other pieces are float32.
    opset : int
    ssiam : str
        Version that exported it.
    """

    name: str
    network: str
    sha256: str
    pieces: tuple[str, ...]
    precision: Precision = "f32"
    opset: int = OPSET
    ssiam: str = VERSION

    @classmethod
    def read(cls, folder: Path) -> Exported:
        """The record of a folder; `WeightsError` if it is missing or damaged."""
        path = folder / RECORD
        if not path.is_file():
            raise WeightsError(
                f"weights folder {folder} holds no {RECORD}: "
                "give one that ssiam weights export has written, or the authors' .pth file"
            )
        try:
            values = json.loads(path.read_text())
            values["pieces"] = tuple(values["pieces"])
            return cls(**values)
        except (ValueError, TypeError, KeyError) as error:
            raise WeightsError(f"{path} is damaged: export the network again") from error

    def write(self, folder: Path) -> None:
        """Store the record, the last of a folder's files."""
        (folder / RECORD).write_text(json.dumps(asdict(self), indent=2) + "\n")


def put(source: Path, folder: Path, files: Iterable[str]) -> None:
    """Move whole files from a folder beside it into `folder`, and last the record.

    A folder without a record is not complete. Raises `OSError`.
    """
    (folder / RECORD).unlink(missing_ok=True)
    for file in (*files, RECORD):
        os.replace(source / file, folder / file)


def export_folder(weights: Path) -> Path | None:
    """The folder of an exported network, given itself or one of its .onnx files; else None."""
    folder = weights.parent if weights.suffix == ".onnx" else weights
    return folder if (folder / RECORD).is_file() else None
