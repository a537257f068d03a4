"""Other repositories' names of the same weights, brought to the names of the networks here.

Those are pysot's, and siamfc-pytorch's for SiamFC.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeVar

__all__ = ["renamed"]

Value = TypeVar("Value")

_PARALLEL: Final = "module."  # put in front by training on several GPUs

_PREFIXES: Final = {  # foolwood/SiamMask
    "features.features.": "backbone.",
    "features.downsample.": "neck.downsample.",
    "rpn_model.": "rpn_head.",
    "mask_model.mask.": "mask_head.",
    "refine_model.": "refine_head.",
}

_MODULES: Final = {
    # got-10k/siamfc, before it became siamfc-pytorch
    "feature.0": "backbone.conv1.0",
    "feature.1": "backbone.conv1.1",
    "feature.4": "backbone.conv2.0",
    "feature.5": "backbone.conv2.1",
    "feature.8": "backbone.conv3.0",
    "feature.9": "backbone.conv3.1",
    "feature.11": "backbone.conv4.0",
    "feature.12": "backbone.conv4.1",
    "feature.14": "backbone.conv5.0",
    # pysot's "alexnet" in place of its "alexnetlegacy"
    "backbone.layer1.0": "backbone.features.0",
    "backbone.layer1.1": "backbone.features.1",
    "backbone.layer2.0": "backbone.features.4",
    "backbone.layer2.1": "backbone.features.5",
    "backbone.layer3.0": "backbone.features.8",
    "backbone.layer3.1": "backbone.features.9",
    "backbone.layer4.0": "backbone.features.11",
    "backbone.layer4.1": "backbone.features.12",
    "backbone.layer5.0": "backbone.features.14",
    "backbone.layer5.1": "backbone.features.15",
}


def renamed(weights: Mapping[str, Value]) -> dict[str, Value]:
    """The same weights, by the names of the networks here; unknown names stay as they are."""
    return {_renamed(key): value for key, value in weights.items()}


def _renamed(key: str) -> str:
    key = key.removeprefix(_PARALLEL)
    for theirs, ours in _PREFIXES.items():
        if key.startswith(theirs):
            return ours + key.removeprefix(theirs)
    module, _, leaf = key.rpartition(".")
    return f"{_MODULES.get(module, module)}.{leaf}" if module else leaf
