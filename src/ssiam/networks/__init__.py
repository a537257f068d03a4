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
from ssiam.networks.checkpoints import read_checkpoint
from ssiam.networks.graphs import (
    InferenceGraph,
    MaskGraph,
    RefineGraph,
    SearchGraph,
    TemplateGraph,
    inference_graphs,
)
from ssiam.networks.siamese import SiameseNetwork
from ssiam.networks.windows import Windows, cut_windows

__all__ = [
    "NETWORKS",
    "InferenceGraph",
    "MaskGraph",
    "NetworkName",
    "RefineGraph",
    "SearchGraph",
    "SiameseNetwork",
    "TemplateGraph",
    "Windows",
    "build_network",
    "cut_windows",
    "inference_graphs",
    "read_checkpoint",
]
