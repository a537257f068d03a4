"""The networks of SiamFC, SiamRPN++ and SiamMask in PyTorch, and their authors' weights.

This room alone needs torch: pip install 'ssiam[torch]'.
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

from ssiam.networks.catalogue import NETWORKS, NetworkName, build_network
from ssiam.networks.checkpoints import Checkpoint, read_checkpoint
from ssiam.networks.export import write_onnx
from ssiam.networks.graphs import (
    InferenceGraph,
    MaskGraph,
    RefineGraph,
    SearchGraph,
    TemplateGraph,
    inference_graphs,
)
from ssiam.networks.runners import GraphRunner, runners
from ssiam.networks.shapes import PieceShapes, piece_shapes
from ssiam.networks.siamese import SiameseNetwork

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
    "inference_graphs",
    "piece_shapes",
    "read_checkpoint",
    "runners",
    "write_onnx",
]
