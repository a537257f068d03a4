"""Loading networks: from an .onnx file, or in pieces from a checkpoint or an exported folder."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from tempfile import gettempdir
from typing import Final, TypeAlias

from ssiam.errors import ArgumentError, SinkError, WeightsError
from ssiam.runtime.files import cache_folder, fingerprint, sha256
from ssiam.runtime.manifest import MANIFEST_FILE, Manifest, find_export, package_version
from ssiam.runtime.network import DeviceName, Network, Precision, RuntimeName, RuntimeOptions
from ssiam.runtime.pytorch import load_torch_pieces, wrong_network_error
from ssiam.unfinished import staging_folder

__all__ = ["Pieces", "load_network", "load_pieces"]

Pieces: TypeAlias = dict[str, Network]

_PAIR: Final = ("template", "search")
# Pieces that a network cannot do without, if they are not these two
_PIECES: Final = {"siammask_r50_l3": (*_PAIR, "refine"), "box_mask": ("mask",)}
_LOG = logging.getLogger(__name__)
_MIN_SHARED_BYTES: Final = 50_000_000  # size of an .onnx file from which weights are shared
_DIGITS: Final = 16  # digits of a checkpoint's digest in the name of its exported folder


def load_network(
    path: Path,
    input_shape: tuple[int, ...] | None = None,
    *,
    runtime: RuntimeName = "openvino",
    threads: int = 1,
    precision: Precision = "f32",
    device: DeviceName | None = None,
) -> Network:
    """Load the network of an .onnx file.

    The runtimes' float32 outputs for the same file differ by less than a thousandth of the
    output's largest magnitude.

    Parameters
    ----------
    path : Path
        The .onnx file.
    input_shape : tuple of int, optional
        Replaces the shape of the first input.
    runtime, threads, precision, device
        As in `RuntimeOptions`.

    Returns
    -------
    Network
        Compiled, with fixed input shapes.

    Raises
    ------
    ArgumentError
        An unknown runtime, or a precision or device that it does not support.
    MissingExtraError
        The runtime is not installed.
    WeightsError
        The file is missing, damaged or of another kind, or int8 was requested of a float32 file.
    """
    options = RuntimeOptions(runtime, threads, precision, device)
    if options.runtime == "torch":
        raise WeightsError(
            f"weights {path} are not for PyTorch, which runs the authors' .pth files: "
            "choose runtime openvino or onnxruntime"
        )
    if options.runtime == "onnxruntime":
        from ssiam.runtime.onnxruntime import OnnxRuntimeNetwork

        return OnnxRuntimeNetwork(path, input_shape, threads, precision, options.resolved_device)
    from ssiam.runtime.openvino import OpenVinoNetwork

    return OpenVinoNetwork(path, input_shape, threads, precision)


def load_pieces(weights: Path, network: str, options: RuntimeOptions) -> Pieces:
    """Load the pieces of a network: template, search, and refine for masks.

    PyTorch runs a .pth file directly. For the other runtimes it is exported once to the user's
    cache folder, in a folder named after its digest; after that PyTorch is not needed.

    Parameters
    ----------
    weights : Path
        The authors' .pth file, a folder that `ssiam weights export` has written, or one of its
        .onnx files.
    network : str
        Name of the expected network.
    options : RuntimeOptions

    Returns
    -------
    dict of str to Network
        The pieces by name.

    Raises
    ------
    WeightsError
        The weights are missing, damaged or of another network.
    MissingExtraError
        A package that the file or the runtime needs is not installed.
    ArgumentError
        int8 was requested of weights that are not exported in int8.
    """
    if not weights.exists():
        raise WeightsError(f"weights {weights} do not exist: give the authors' .pth file")
    if options.runtime == "torch":
        return load_torch_pieces(weights, network, options)
    folder = find_export(weights)
    if folder is not None:
        return _load_export(folder, network, options)
    if weights.suffix == ".onnx":
        Manifest.read(weights.parent)  # raises: there is no manifest
    if options.precision == "int8":
        raise ArgumentError(
            f"weights {weights} are not in int8: export them with "
            "ssiam weights export NAME FILE --precision int8 --pictures VIDEO"
        )
    return _export_and_load(weights, network, options)


def _load_export(folder: Path, network: str, options: RuntimeOptions) -> Pieces:
    manifest = Manifest.read(folder)
    if manifest.network != network:
        raise wrong_network_error(folder, manifest.network, network)
    if options.precision == "int8" and manifest.precision != "int8":
        raise ArgumentError(
            f"weights {folder} are not in int8: write those with ssiam weights export "
            f"{manifest.name} [FILE] --precision int8 --pictures VIDEO, and give their folder"
        )
    paths = {piece: folder / f"{piece}.onnx" for piece in manifest.pieces}
    pieces = _load_shared(paths, manifest, options)
    for piece, path in paths.items():
        if piece not in pieces:
            pieces[piece] = load_network(
                path,
                runtime=options.runtime,
                threads=options.threads,
                precision=_arithmetic(options),
                device=options.device,
            )
    _check_pieces(folder, network, pieces)
    return pieces


def _check_pieces(folder: Path, network: str, pieces: Pieces) -> None:
    """Raise `WeightsError` unless all pieces are there, and search takes what template gives.

    It may leave out the last ones: lite without attention takes no context.
    """
    missing = [name for name in _PIECES.get(network, _PAIR) if name not in pieces]
    if missing:
        raise WeightsError(
            f"weights folder {folder} holds no {missing[0]}.onnx by its {MANIFEST_FILE}: "
            "export the network again"
        )
    if "template" in pieces:
        kernels = pieces["template"].output_shapes
        accepted = pieces["search"].input_shapes[1 : 1 + len(kernels)]
        if not accepted or accepted != kernels[: len(accepted)]:
            raise WeightsError(
                f"weights folder {folder} holds pieces of different networks: template gives "
                f"{kernels}, search takes {accepted}; export the network again"
            )


def _load_shared(paths: Mapping[str, Path], manifest: Manifest, options: RuntimeOptions) -> Pieces:
    """The large pieces, loaded with one copy of the backbone's weights in memory.

    Empty for runtimes other than OpenVINO, and for int8, where the weights of the search piece
    differ.
    """
    if options.runtime != "openvino" or manifest.precision == "int8":
        return {}
    from ssiam.runtime.openvino import load_with_shared_weights

    large = {
        piece: path
        for piece, path in paths.items()
        if path.is_file() and path.stat().st_size >= _MIN_SHARED_BYTES
    }
    if len(large) < 2:
        return {}
    files = list(large.values())
    digest = fingerprint(files, manifest.cache_key)
    networks = load_with_shared_weights(files, digest, options.threads, _arithmetic(options))
    return dict(zip(large, networks, strict=True))


def _arithmetic(options: RuntimeOptions) -> Precision:
    """Precision to compile with; in an int8 file the layers are already quantized."""
    return "bf16" if options.precision == "bf16" else "f32"


def _export_and_load(weights: Path, network: str, options: RuntimeOptions) -> Pieces:
    """The pieces of a .pth file, exported to the user's cache folder if that can be written."""
    path = weights
    if weights.is_dir():
        files = sorted(weights.glob("*.pth"))
        if len(files) != 1:
            Manifest.read(weights)  # raises: there is no manifest
        path = files[0]
    folder = cache_folder() / "networks" / f"{sha256(path)[:_DIGITS]}-{package_version()}"
    if find_export(folder) is None:
        from ssiam.runtime.export import export_network

        try:
            export_network(path, folder, name=network, network=network)
        except SinkError as error:
            _LOG.warning("the exported network is not cached: %s", error)
            with staging_folder(Path(gettempdir()), "ssiam-network-") as temporary:
                export_network(path, temporary, name=network, network=network)
                return _load_export(temporary, network, options)
    return _load_export(folder, network, options)
