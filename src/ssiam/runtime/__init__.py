"""Running networks on OpenVINO, ONNX Runtime or PyTorch behind one protocol.

`load_network` and `load_pieces` are imported on first use, so that ``import ssiam`` stays fast.
"""

from typing import TYPE_CHECKING, Any

from ssiam.runtime.model_zoo import MODEL_ZOO, PublishedWeights
from ssiam.runtime.network import (
    DeviceName,
    Network,
    Precision,
    RuntimeName,
    RuntimeOptions,
    Tensor,
)

if TYPE_CHECKING:
    from ssiam.runtime.loading import load_network, load_pieces

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


def __getattr__(name: str) -> Any:
    if name in ("load_network", "load_pieces"):
        from ssiam.runtime import loading

        return getattr(loading, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
