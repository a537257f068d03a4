"""State dicts of other repositories: renaming of their keys, and recognition of the network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final, TypeAlias, TypeVar

import torch

from ssiam.networks.registry import NETWORKS, NetworkName, build_network

__all__ = ["COUNTERS", "FOOLWOOD", "PARALLEL", "Difference", "Shapes", "recognize", "rename_keys"]

Shapes: TypeAlias = Mapping[str, tuple[int, ...]]
"""Shapes of weights, by name."""

Value = TypeVar("Value")

# Counters of batch normalization, used only in training. PyTorch 0.4 does not store them.
COUNTERS: Final = "num_batches_tracked"
_MIN_SHARE: Final = 0.5  # of a network's weights that must be present to recognize it
_LISTED: Final = 3  # names of each kind in a message

PARALLEL: Final = "module."  # prefix of torch.nn.DataParallel

FOOLWOOD: Final = "features.features."  # prefix of the backbone in foolwood/SiamMask

_PREFIXES: Final = {  # foolwood/SiamMask
    FOOLWOOD: "backbone.",
    "features.downsample.": "neck.downsample.",
    "rpn_model.": "rpn_head.",
    "mask_model.mask.": "mask_head.",
    "refine_model.": "refine_head.",
}

_MODULES: Final = {
    # got-10k/siamfc, the predecessor of siamfc-pytorch
    "feature.0": "backbone.conv1.0",
    "feature.1": "backbone.conv1.1",
    "feature.4": "backbone.conv2.0",
    "feature.5": "backbone.conv2.1",
    "feature.8": "backbone.conv3.0",
    "feature.9": "backbone.conv3.1",
    "feature.11": "backbone.conv4.0",
    "feature.12": "backbone.conv4.1",
    "feature.14": "backbone.conv5.0",
    # pysot's "alexnet" instead of its "alexnetlegacy"
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


def rename_keys(weights: Mapping[str, Value]) -> dict[str, Value]:
    """The same weights with this package's key names; unknown names are kept.

    This package's names are those of pysot, and for SiamFC those of siamfc-pytorch.
    """
    return {_rename(key): value for key, value in weights.items()}


def _rename(key: str) -> str:
    key = key.removeprefix(PARALLEL)
    for theirs, ours in _PREFIXES.items():
        if key.startswith(theirs):
            return ours + key.removeprefix(theirs)
    module, _, leaf = key.rpartition(".")
    return f"{_MODULES.get(module, module)}.{leaf}" if module else leaf


@dataclass(frozen=True)
class Difference:
    """The difference between weights and those of the most similar network.

    Attributes
    ----------
    network : str
        Name of the most similar network, None if less than half of its weights are present.
    missing, unexpected, reshaped : tuple of str
        Names of weights; `reshaped` has both shapes in the text.
    """

    network: NetworkName | None
    missing: tuple[str, ...] = ()
    unexpected: tuple[str, ...] = ()
    reshaped: tuple[str, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether the weights are exactly those of the network."""
        return self.network is not None and not (self.missing or self.unexpected or self.reshaped)

    def __str__(self) -> str:
        kinds = {
            "missing": self.missing,
            "unexpected": self.unexpected,
            "of another shape": self.reshaped,
        }
        return "; ".join(f"{kind}: {_abbreviated(names)}" for kind, names in kinds.items() if names)


def recognize(shapes: Shapes) -> Difference:
    """The network most similar to some weights, and the differences from it.

    Parameters
    ----------
    shapes : mapping of str to tuple of int
        Shapes by name, after `rename_keys`; `num_batches_tracked` is ignored.
    """
    given = {key: shape for key, shape in shapes.items() if not key.endswith(COUNTERS)}
    nearest = max(NETWORKS, key=lambda name: _similarity(given, _expected_shapes(name)))
    expected = _expected_shapes(nearest)
    if len(given.keys() & expected.keys()) < _MIN_SHARE * len(expected):
        return Difference(None, unexpected=tuple(given))
    return Difference(
        nearest,
        missing=tuple(key for key in expected if key not in given),
        unexpected=tuple(key for key in given if key not in expected),
        reshaped=tuple(
            f"{key} {given[key]} instead of {expected[key]}"
            for key in expected
            if key in given and given[key] != expected[key]
        ),
    )


@cache
def _expected_shapes(name: NetworkName) -> Shapes:
    """Shapes of a network's weights, without `num_batches_tracked`."""
    with torch.device("meta"):
        weights = build_network(name).state_dict()
    return {key: tuple(value.shape) for key, value in weights.items() if not key.endswith(COUNTERS)}


def _similarity(given: Shapes, expected: Shapes) -> float:
    """Intersection over union of two sets of weights, 0 to 1."""
    common = given.items() & expected.items()
    return len(common) / len({**given, **expected})


def _abbreviated(names: tuple[str, ...]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
