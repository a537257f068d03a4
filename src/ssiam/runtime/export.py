"""From the authors' .pth to ONNX: pieces written, checked against PyTorch, and recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from ssiam.errors import ArgumentError, WeightsError
from ssiam.outputs import output_error
from ssiam.runtime.calibration import calibration_feeds, quantise
from ssiam.runtime.exported import OPSET, Exported, put
from ssiam.runtime.files import sha256
from ssiam.runtime.network import Network, Tensor
from ssiam.runtime.openvino import OpenVinoNetwork
from ssiam.runtime.pytorch import read_network

if TYPE_CHECKING:
    from ssiam.networks import Checkpoint, SiameseNetwork

__all__ = ["TOLERANCE", "distance", "export_network"]

TOLERANCE: Final = 1e-3  # of an output's greatest magnitude, between PyTorch and the files


def export_network(
    weights: Path,
    folder: Path,
    *,
    name: str,
    network: str,
    precision: Literal["f32", "int8"] = "f32",
    pictures: Sequence[Any] = (),
) -> Exported:
    """Write a checkpoint's network as .onnx files.

    They are template.onnx, search.onnx, and refine.onnx for masks, in float32; with `precision`
    "int8" search.onnx, which runs once a frame, computes in eight bits. The float32 files are
    compared with PyTorch on noise before anything is kept.

    Parameters
    ----------
    weights : Path
        The authors' .pth file, or the folder that holds it alone.
    folder : Path
        Where the files are written; made if it is not there.
    name : str
        Name for the record: the tracker's.
    network : str
        Which network the file has to be.
    precision : {"f32", "int8"}
    pictures : sequence of (H, W, 3) uint8 BGR
        What an int8 network is calibrated on.

    Raises
    ------
    MissingExtraError
        PyTorch or onnx is not installed, or for int8 ONNX Runtime.
    WeightsError
        The file is missing, damaged or of another network, or the written files do not compute
        the same.
    ArgumentError
        int8 without pictures.
    SinkError
        The folder cannot be written.
    """
    if precision == "int8" and not pictures:
        raise ArgumentError("int8 needs pictures to calibrate on: give --pictures VIDEO or FOLDER")
    checkpoint = read_network(weights, network)
    path = weights if weights.is_file() else next(weights.glob("*.pth"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder, prefix=".export-") as temporary:
            pieces = _written(checkpoint, Path(temporary))
            if precision == "int8":
                _quantised(Path(temporary), pictures, rgb=network == "siamfc")
            record = Exported(name, network, sha256(path), pieces, precision)
            record.write(Path(temporary))
            put(Path(temporary), folder, [f"{piece}.onnx" for piece in pieces])
    except OSError as error:
        raise output_error(folder, error) from error
    return record


def distance(found: Tensor, expected: Tensor) -> float:
    """Greatest difference of two arrays, as a share of the greatest magnitude of the second."""
    return float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-12))


def _written(checkpoint: Checkpoint, folder: Path) -> tuple[str, ...]:
    """Write and compare the pieces; their names."""
    from ssiam.networks import inference_graphs, runners, write_onnx

    expected = runners(checkpoint)
    for piece, (feed, responses) in _on_noise(checkpoint.network, expected).items():
        graph, path = inference_graphs(checkpoint.network)[piece], folder / f"{piece}.onnx"
        write_onnx(graph, [each.shape for each in feed], path, opset=OPSET)
        found = OpenVinoNetwork(path, cached=False)(*feed)
        off = max(map(distance, found, responses))
        if not off <= TOLERANCE:
            raise WeightsError(
                f"the {piece} piece of {checkpoint.name} as ONNX differs from PyTorch by {off:.1e} "
                f"of its greatest value, more than {TOLERANCE:.0e}: it was not kept; "
                "use runtime torch"
            )
    return tuple(expected)


def _on_noise(
    network: SiameseNetwork, pieces: Mapping[str, Network]
) -> dict[str, tuple[list[Tensor], list[Tensor]]]:
    """What the pieces make of crops of noise, and of each other's outputs: inputs and outputs."""
    random = np.random.default_rng(0)
    template, search = (
        random.integers(0, 256, shape).astype(np.float32)
        for shape in (network.template_shape, network.search_shape)
    )
    kernels = pieces["template"](template)
    feed = [search, *kernels]
    responses = pieces["search"](*feed)
    found = {"template": ([template], kernels), "search": (feed, responses)}
    for piece in pieces.keys() - found.keys():  # refine or mask
        sources = [*responses[3:], responses[2]]
        feed = [_middle(*each) for each in zip(sources, pieces[piece].input_shapes, strict=True)]
        found[piece] = (feed, pieces[piece](*feed))
    return found


def _middle(features: Tensor, shape: tuple[int, ...]) -> Tensor:
    """The middle (1, C, n, n) of features."""
    side = shape[-1]
    start = (features.shape[-1] - side) // 2
    middle = slice(start, start + side)
    return np.ascontiguousarray(features[:, :, middle, middle])


def _quantised(folder: Path, pictures: Sequence[Any], *, rgb: bool) -> None:
    """Replace the search piece by one in eight bits."""
    template = OpenVinoNetwork(folder / "template.onnx", cached=False)
    path, exact = folder / "search.onnx", folder / "search-f32.onnx"
    path.rename(exact)
    shape = OpenVinoNetwork(exact, cached=False).input_shapes[0]
    quantise(exact, path, calibration_feeds(template, shape, pictures, rgb=rgb))
