"""The networks of SiamFC, SiamRPN++, SiamMask and lite in PyTorch, and the authors' weights.

This package needs PyTorch: pip install 'ssiam[torch]'. `ssiam.training` imports it; other packages
import it only when a checkpoint is read.
"""

from ssiam.errors import MissingExtraError

try:
    import torch  # noqa: F401
except ModuleNotFoundError as error:
    if error.name != "torch":
        raise
    raise MissingExtraError(
        "PyTorch is not installed, which these weights need: pip install 'ssiam[torch]'"
    ) from error

from ssiam.networks.base import SiameseNetwork
from ssiam.networks.checkpoints import Checkpoint, read_checkpoint
from ssiam.networks.export import (
    InferenceGraph,
    MaskGraph,
    RefineGraph,
    SearchGraph,
    TemplateGraph,
    inference_graphs,
    write_onnx,
)
from ssiam.networks.registry import NETWORKS, NetworkName, build_network
from ssiam.networks.runners import GraphRunner, PieceShapes, graph_runners, piece_shapes

__all__ = [
    "NETWORKS",
    "Checkpoint",
    "GraphRunner",
    "InferenceGraph",
    "MaskGraph",
    "NetworkName",
    "PieceShapes",
    "RefineGraph",
    "SearchGraph",
    "SiameseNetwork",
    "TemplateGraph",
    "build_network",
    "graph_runners",
    "inference_graphs",
    "piece_shapes",
    "read_checkpoint",
    "write_onnx",
]
