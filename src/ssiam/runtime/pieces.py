"""A network's pieces from whatever the user has: a checkpoint, or an exported folder."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from ssiam.errors import ArgumentError, SinkError, WeightsError
from ssiam.runtime import load_network
from ssiam.runtime.exported import VERSION, Exported, export_folder
from ssiam.runtime.files import cache_folder, identity, sha256
from ssiam.runtime.network import Network, Precision, Running
from ssiam.runtime.pytorch import another_network, torch_pieces

__all__ = ["Pieces", "load_pieces"]

Pieces = dict[str, Network]

_LOG = logging.getLogger(__name__)
_WORTH_SHARING: Final = 50_000_000  # bytes of an .onnx file
_DIGITS: Final = 16  # of a file's digest in the name of its exported folder


def load_pieces(weights: Path, network: str, running: Running) -> Pieces:
    """The pieces of a network by name: template, search, and refine for masks.

    A .pth file runs on PyTorch as it is. For the other runtimes it is exported once, into the
    user's cache folder, under its own digest; PyTorch is not needed from then on.

    Parameters
    ----------
    weights : Path
        The authors' .pth file, a folder that `ssiam weights export` has written, or one of its
        .onnx files.
    network : str
        Which network it has to be.
    running : Running

    Raises
    ------
    WeightsError
        Missing, damaged or of another network.
    MissingExtraError
        What the file or the runtime needs is not installed.
    ArgumentError
        int8 of a .pth file, for that needs pictures.
    """
    if not weights.exists():
        raise WeightsError(f"weights {weights} do not exist: give the authors' .pth file")
    if running.runtime == "torch":
        return torch_pieces(weights, network, running)
    folder = export_folder(weights)
    if folder is not None:
        return _exported_pieces(folder, network, running)
    if weights.suffix == ".onnx":
        Exported.read(weights.parent)  # says what is missing
    if running.precision == "int8":
        raise ArgumentError(
            f"weights {weights} are not in int8: export them so, "
            "ssiam weights export NAME FILE --precision int8 --pictures VIDEO"
        )
    return _converted_pieces(weights, network, running)


def _exported_pieces(folder: Path, network: str, running: Running) -> Pieces:
    exported = Exported.read(folder)
    if exported.network != network:
        raise another_network(folder, exported.network, network)
    if running.precision == "int8" and exported.precision != "int8":
        raise ArgumentError(
            f"weights {folder} are not in int8: export the .pth file so, "
            f"ssiam weights export {exported.name} FILE --precision int8 --pictures VIDEO"
        )
    paths = {piece: folder / f"{piece}.onnx" for piece in exported.pieces}
    pieces = _together(paths, exported, running)
    for piece, path in paths.items():
        if piece not in pieces:
            pieces[piece] = load_network(
                path,
                runtime=running.runtime,
                threads=running.threads,
                precision=_arithmetic(running),
                device=running.device,
            )
    return pieces


def _together(paths: Mapping[str, Path], exported: Exported, running: Running) -> Pieces:
    """The large pieces, whose backbones are the same, with its weights in memory once.

    None of int8, whose search piece has other weights, and none on another runtime.
    """
    if running.runtime != "openvino" or exported.precision == "int8":
        return {}
    from ssiam.runtime.openvino_joint import load_together

    large = {
        piece: path
        for piece, path in paths.items()
        if path.is_file() and path.stat().st_size >= _WORTH_SHARING
    }
    if len(large) < 2:
        return {}
    files = list(large.values())
    digest = identity(files, str(exported))
    networks = load_together(files, digest, running.threads, _arithmetic(running))
    return dict(zip(large, networks, strict=True))


def _arithmetic(running: Running) -> Precision:
    return "bf16" if running.precision == "bf16" else "f32"


def _converted_pieces(weights: Path, network: str, running: Running) -> Pieces:
    """Pieces of a .pth file by way of ONNX, kept in the user's cache folder where that works."""
    path = weights
    if weights.is_dir():
        files = sorted(weights.glob("*.pth"))
        if len(files) != 1:
            Exported.read(weights)  # says what is missing
        path = files[0]
    folder = cache_folder() / "networks" / f"{sha256(path)[:_DIGITS]}-{VERSION}"
    if export_folder(folder) is None:
        from ssiam.runtime.export import export_network

        try:
            export_network(path, folder, name=network, network=network)
        except SinkError as error:
            _LOG.warning("the exported network is not kept: %s", error)
            with TemporaryDirectory(prefix="ssiam-") as temporary:
                export_network(path, Path(temporary), name=network, network=network)
                return _exported_pieces(Path(temporary), network, running)
    return _exported_pieces(folder, network, running)
