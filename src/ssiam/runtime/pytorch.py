"""Networks on PyTorch, straight from the authors' checkpoints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ssiam.errors import WeightsError, check_choice
from ssiam.runtime.network import Network, Running

if TYPE_CHECKING:
    from ssiam.networks import Checkpoint

__all__ = ["read_network", "torch_pieces"]


def torch_pieces(weights: Path, network: str, running: Running) -> dict[str, Network]:
    """The pieces of a checkpoint's network by name: template, search, and refine for masks.

    Correlations are convolutions here, and tensors are in channels-last order.

    Parameters
    ----------
    weights : Path
        The .pth file, or the folder that holds it alone.
    network : str
        Name of the network that it has to be.
    running : Running
        On the devices cuda and mps precision "f16" computes in half precision.

    Raises
    ------
    MissingExtraError
        PyTorch is not installed.
    WeightsError
        The file is missing, damaged or of another network.
    ArgumentError
        The device is not there.
    """
    from ssiam.networks import runners
    from ssiam.networks.runners import TorchDevice, TorchPrecision

    devices: tuple[TorchDevice, ...] = ("cpu", "cuda", "mps")
    precisions: tuple[TorchPrecision, ...] = ("f32", "bf16", "f16")
    pieces = runners(
        read_network(weights, network),
        device=check_choice("device", running.where, devices),
        precision=check_choice("precision", running.precision, precisions),
        threads=running.threads,
    )
    return dict(pieces)


def read_network(weights: Path, network: str) -> Checkpoint:
    """The checkpoint of a .pth file, or of the only one in a folder.

    Raises `WeightsError`, which names both networks, if it is another one than `network`.
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
        raise another_network(path, checkpoint.name, network)
    return checkpoint


def another_network(path: Path, found: str, wanted: str) -> WeightsError:
    """The error for weights that are in order and not those that were asked for."""
    return WeightsError(
        f"weights {path} are those of {found}, not of {wanted}: "
        f"give a file of {wanted}, or choose a tracker with {found}"
    )


def _only_checkpoint(folder: Path) -> Path:
    files = sorted(folder.glob("*.pth"))
    if len(files) != 1:
        raise WeightsError(
            f"weights folder {folder} holds {len(files)} .pth files: give one of them by its path"
        )
    return files[0]
