"""What a run leaves behind: the weights, and the pieces that a tracker runs."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from ssiam.networks import inference_graphs, write_onnx
from ssiam.networks.lite import LiteNetwork
from ssiam.runtime.exported import OPSET, Exported
from ssiam.runtime.files import sha256
from ssiam.training.checkpoints import write_file

__all__ = ["NETWORK", "WEIGHTS", "write_network"]

NETWORK: Final = "lite"  # in the record beside the pieces
WEIGHTS: Final = "weights.pth"
_KERNEL: Final = (1, 64, 96)


def write_network(network: LiteNetwork, folder: Path) -> None:
    """Write weights.pth, template.onnx, search.onnx, mask.onnx and the record of them.

    Raises
    ------
    MissingExtraError
        The package onnx is not installed.
    SinkError, OSError
        The folder cannot be written.
    """
    write_file(folder / WEIGHTS, network.state_dict())
    graphs = inference_graphs(network)
    shapes: dict[str, list[tuple[int, ...]]] = {
        "template": [network.template_shape],
        "search": [network.search_shape, _KERNEL],
        "mask": [(1, 96, 32, 32), (1, 24, 64, 64)],
    }
    for piece, graph in graphs.items():
        write_onnx(graph, shapes[piece], folder / f"{piece}.onnx", opset=OPSET)
    record = Exported(NETWORK, NETWORK, sha256(folder / WEIGHTS), tuple(graphs))
    record.write(folder)
