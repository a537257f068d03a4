"""Export of the authors' .pth files to ONNX, with a check against PyTorch."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from ssiam.errors import ArgumentError, WeightsError
from ssiam.outputs import check_distinct
from ssiam.runtime.files import sha256
from ssiam.runtime.manifest import OPSET, Manifest, atomic_export, package_version
from ssiam.runtime.network import Network, Tensor
from ssiam.runtime.openvino import OpenVinoNetwork
from ssiam.runtime.pytorch import read_network, wrong_network_error
from ssiam.runtime.quantization import calibration_feeds, quantize

if TYPE_CHECKING:
    from ssiam.networks import Checkpoint, SiameseNetwork

__all__ = ["TOLERANCE", "export_network", "quantize_export", "relative_difference"]

TOLERANCE: Final = 1e-3  # between PyTorch and the files, see `relative_difference`


def export_network(
    weights: Path,
    folder: Path,
    *,
    name: str,
    network: str,
    precision: Literal["f32", "int8"] = "f32",
    images: Sequence[Any] = (),
) -> Manifest:
    """Write a checkpoint's network as .onnx files.

    The files are template.onnx, search.onnx, and refine.onnx for masks, in float32. With
    `precision` "int8", search.onnx, which runs once per frame, is quantized. The float32 files
    are compared with PyTorch on noise before any file is moved to `folder`.

    Parameters
    ----------
    weights : Path
        The authors' .pth file, or a folder with only one.
    folder : Path
        The output folder, created if it does not exist.
    name : str
        Name of the tracker, for the manifest.
    network : str
        Name of the expected network.
    precision : {"f32", "int8"}
        Precision of search.onnx.
    images : sequence of (H, W, 3) uint8 BGR
        Images for the calibration of an int8 network.

    Returns
    -------
    Manifest
        As stored in the folder.

    Raises
    ------
    MissingExtraError
        PyTorch or onnx is not installed, or for int8 ONNX Runtime.
    WeightsError
        The file is missing, damaged or of another network, or the exported files differ from
        PyTorch by more than `TOLERANCE`.
    ArgumentError
        int8 without images.
    SinkError
        The folder cannot be written.
    """
    if precision == "int8":
        _check_images(images)
    checkpoint = read_network(weights, network)
    path = weights if weights.is_file() else next(weights.glob("*.pth"))
    with atomic_export(folder) as temporary:
        pieces = _write_pieces(checkpoint, temporary)
        if precision == "int8":
            _quantize_search(temporary, images, rgb=network == "siamfc")
        manifest = Manifest(name, network, sha256(path), pieces, precision)
        manifest.write(temporary)
    return manifest


def quantize_export(source: Path, folder: Path, network: str, images: Sequence[Any]) -> Manifest:
    """Write an int8 version of a network that is exported in float32.

    search.onnx, which runs once per frame, is quantized; the other pieces are copied.

    Parameters
    ----------
    source : Path
        Folder of the float32 network.
    folder : Path
        The output folder, created if it does not exist.
    network : str
        Name of the expected network.
    images : sequence of (H, W, 3) uint8 BGR
        Images for the calibration.

    Returns
    -------
    Manifest
        As stored in the output folder.

    Raises
    ------
    MissingExtraError
        ONNX Runtime is not installed.
    WeightsError
        The folder holds no exported network, or another one, or it is in int8 already.
    ArgumentError
        There are no images, or both folders are the same.
    SinkError
        The folder cannot be written.
    """
    _check_images(images)
    manifest = Manifest.read(source)
    if manifest.network != network:
        raise wrong_network_error(source, manifest.network, network)
    if manifest.precision != "f32":
        raise WeightsError(f"weights {source} are in {manifest.precision}: give those in f32")
    check_distinct([("the int8 network", folder)], [("the network", source)])
    with atomic_export(folder) as temporary:
        for piece in manifest.pieces:
            shutil.copyfile(source / f"{piece}.onnx", temporary / f"{piece}.onnx")
        _quantize_search(temporary, images, rgb=False)
        quantized = replace(manifest, precision="int8", ssiam=package_version())
        quantized.write(temporary)
    return quantized


def _check_images(images: Sequence[Any]) -> None:
    if not images:
        raise ArgumentError("int8 needs images to calibrate on: give --pictures VIDEO or FOLDER")


def relative_difference(actual: Tensor, expected: Tensor) -> float:
    """Largest difference of two arrays of one shape, relative to the largest |expected|."""
    return float(np.abs(actual - expected).max() / max(np.abs(expected).max(), 1e-12))


def _write_pieces(checkpoint: Checkpoint, folder: Path) -> tuple[str, ...]:
    """Write the pieces and compare them with PyTorch; returns their names."""
    from ssiam.networks import graph_runners, inference_graphs, write_onnx

    runners = graph_runners(checkpoint)
    for piece, (feed, expected) in _run_on_noise(checkpoint.network, runners).items():
        graph, path = inference_graphs(checkpoint.network)[piece], folder / f"{piece}.onnx"
        write_onnx(graph, [each.shape for each in feed], path, opset=OPSET)
        actual = OpenVinoNetwork(path, cached=False)(*feed)
        difference = max(map(relative_difference, actual, expected))
        if not difference <= TOLERANCE:
            raise WeightsError(
                f"the {piece} piece of {checkpoint.name} in ONNX differs from PyTorch by "
                f"{difference:.1e} of its largest value, more than {TOLERANCE:.0e}: "
                "nothing was written; use runtime torch"
            )
    return tuple(runners)


def _run_on_noise(
    network: SiameseNetwork, pieces: Mapping[str, Network]
) -> dict[str, tuple[list[Tensor], list[Tensor]]]:
    """Inputs and outputs of each piece, run on crops of noise and on other pieces' outputs."""
    random = np.random.default_rng(0)
    template, search = (
        random.integers(0, 256, shape).astype(np.float32)
        for shape in (network.template_shape, network.search_shape)
    )
    kernels = pieces["template"](template)
    feed = [search, *kernels]
    responses = pieces["search"](*feed)
    runs = {"template": ([template], kernels), "search": (feed, responses)}
    for piece in pieces.keys() - runs.keys():  # refine or mask
        sources = [*responses[3:], responses[2]]
        feed = [_center(*pair) for pair in zip(sources, pieces[piece].input_shapes, strict=True)]
        runs[piece] = (feed, pieces[piece](*feed))
    return runs


def _center(features: Tensor, shape: tuple[int, ...]) -> Tensor:
    """The central (1, C, n, n) of features (1, C, N, N), for `shape` (1, C, n, n)."""
    side = shape[-1]
    start = (features.shape[-1] - side) // 2
    cells = slice(start, start + side)
    return np.ascontiguousarray(features[:, :, cells, cells])


def _quantize_search(folder: Path, images: Sequence[Any], *, rgb: bool) -> None:
    """Replace the search piece with its int8 version."""
    template = OpenVinoNetwork(folder / "template.onnx", cached=False)
    path, exact = folder / "search.onnx", folder / "search-f32.onnx"
    path.rename(exact)
    shapes = OpenVinoNetwork(exact, cached=False).input_shapes
    quantize(exact, path, calibration_feeds(template, shapes, images, rgb=rgb))
