"""Running networks on OpenVINO, ONNX Runtime or PyTorch behind one protocol."""

from ssiam.runtime.loading import load_network, load_pieces
from ssiam.runtime.model_zoo import MODEL_ZOO, PublishedWeights
from ssiam.runtime.network import (
    DeviceName,
    Network,
    Precision,
    RuntimeName,
    RuntimeOptions,
    Tensor,
)

__all__ = [
    "MODEL_ZOO",
    "DeviceName",
    "Network",
    "Precision",
    "PublishedWeights",
    "RuntimeName",
    "RuntimeOptions",
    "Tensor",
    "load_network",
    "load_pieces",
]
