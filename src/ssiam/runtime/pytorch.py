"""Networks on PyTorch, loaded from the authors' checkpoints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ssiam.errors import WeightsError, check_choice
from ssiam.runtime.network import Network, RuntimeOptions

if TYPE_CHECKING:
    from ssiam.networks import Checkpoint

__all__ = ["load_torch_pieces", "read_network", "wrong_network_error"]


def load_torch_pieces(weights: Path, network: str, options: RuntimeOptions) -> dict[str, Network]:
    """Load the pieces of a checkpoint's network: template, search, and refine for masks.

    Correlations are computed as convolutions, and tensors are in channels-last order.

    Parameters
    ----------
    weights : Path
        The .pth file, or a folder with only one.
    network : str
        Name of the expected network.
    options : RuntimeOptions
        Precision "f16" is half precision, for the devices cuda and mps.

    Returns
    -------
    dict of str to Network
        The pieces by name.

    Raises
    ------
    MissingExtraError
        PyTorch is not installed.
    WeightsError
        The file is missing, damaged or of another network.
    ArgumentError
        The device is not available.
    """
    from ssiam.networks import graph_runners
    from ssiam.networks.runners import TorchDevice, TorchPrecision

    devices: tuple[TorchDevice, ...] = ("cpu", "cuda", "mps")
    precisions: tuple[TorchPrecision, ...] = ("f32", "bf16", "f16")
    pieces = graph_runners(
        read_network(weights, network),
        device=check_choice("device", options.resolved_device, devices),
        precision=check_choice("precision", options.precision, precisions),
        threads=options.threads,
    )
    return dict(pieces)


def read_network(weights: Path, network: str) -> Checkpoint:
    """The checkpoint of a .pth file, or of the only one in a folder.

    Raises `WeightsError` if it is not of `network`; the message names both networks.
    """
    from ssiam.networks import read_checkpoint

    path = _only_checkpoint(weights) if weights.is_dir() else weights
    if path.suffix == ".onnx":
        raise WeightsError(
            f"weights {path} are ONNX, which PyTorch does not run: "
            "give the authors' .pth file, or choose runtime openvino or onnxruntime"
        )
    checkpoint = read_checkpoint(path)
    if checkpoint.name != network:
        raise wrong_network_error(path, checkpoint.name, network)
    return checkpoint


def wrong_network_error(path: Path, found: str, expected: str) -> WeightsError:
    """The error for valid weights of a network other than the expected one."""
    return WeightsError(
        f"weights {path} are those of {found}, not of {expected}: "
        f"give a file of {expected}, or choose a tracker with {found}"
    )


def _only_checkpoint(folder: Path) -> Path:
    files = sorted(folder.glob("*.pth"))
    if len(files) != 1:
        raise WeightsError(
            f"weights folder {folder} holds {len(files)} .pth files: give the path of one of them"
        )
    return files[0]
