"""Which network some weights belong to, told from their names and shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final, TypeAlias

import torch

from ssiam.networks.catalogue import NETWORKS, NetworkName, build_network

__all__ = ["COUNTERS", "Difference", "Shapes", "expected_shapes", "recognise"]

Shapes: TypeAlias = Mapping[str, tuple[int, ...]]

COUNTERS: Final = "num_batches_tracked"  # of the training alone; old PyTorch did not store them
_KNOWN_FROM: Final = 0.5  # share of a network's weights from which it is taken for that network
_LISTED: Final = 3  # names of each kind in an error


@dataclass(frozen=True)
class Difference:
    """How weights differ from those of the network that they are nearest to.

    Attributes
    ----------
    network : str
        The nearest network's name, or None if none is near.
    missing, unexpected, reshaped : tuple of str
        Names, those reshaped with both shapes.
    """

    network: NetworkName | None
    missing: tuple[str, ...] = ()
    unexpected: tuple[str, ...] = ()
    reshaped: tuple[str, ...] = ()

    @property
    def is_none(self) -> bool:
        """Whether the weights are exactly the network's."""
        return self.network is not None and not (self.missing or self.unexpected or self.reshaped)

    def __str__(self) -> str:
        kinds = {
            "missing": self.missing,
            "unexpected": self.unexpected,
            "of another shape": self.reshaped,
        }
        return "; ".join(f"{kind}: {_listed(names)}" for kind, names in kinds.items() if names)


def recognise(shapes: Shapes) -> Difference:
    """The network with the most of these weights, and where it differs from them.

    Parameters
    ----------
    shapes : mapping of str to tuple of int
        Shapes by the names of the networks here; `num_batches_tracked` does not count.
    """
    given = {key: shape for key, shape in shapes.items() if not key.endswith(COUNTERS)}
    nearest = max(NETWORKS, key=lambda name: _likeness(given, expected_shapes(name)))
    expected = expected_shapes(nearest)
    if len(given.keys() & expected.keys()) < _KNOWN_FROM * len(expected):
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
def expected_shapes(name: NetworkName) -> Shapes:
    """Shapes of a network's weights by name, without `num_batches_tracked`."""
    with torch.device("meta"):
        weights = build_network(name).state_dict()
    return {key: tuple(value.shape) for key, value in weights.items() if not key.endswith(COUNTERS)}


def _likeness(given: Shapes, expected: Shapes) -> float:
    """Share of the weights in either that are in both, 0 to 1."""
    common = given.items() & expected.items()
    return len(common) / len({**given, **expected})


def _listed(names: tuple[str, ...]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
