"""Shapes that go in and out of a network's inference pieces, told without computing anything."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import NamedTuple, TypeAlias

import torch
from torch import Tensor

from ssiam.networks.catalogue import NetworkName, build_network
from ssiam.networks.graphs import InferenceGraph, MaskGraph, RefineGraph, inference_graphs

__all__ = ["PieceShapes", "piece_shapes"]

Shape: TypeAlias = tuple[int, ...]


class PieceShapes(NamedTuple):
    """Shapes of one piece's inputs and outputs, in their order.

    Threads: a value; any number of threads may share it.
    """

    inputs: list[Shape]
    outputs: list[Shape]


@cache
def piece_shapes(name: NetworkName) -> dict[str, PieceShapes]:
    """Shapes by the piece's name, as `inference_graphs` has them."""
    with torch.device("meta"):
        network = build_network(name)
        graphs = inference_graphs(network)
        found = {"template": _shapes(graphs["template"], [network.template_shape])}
        found["search"] = _shapes(
            graphs["search"], [network.search_shape, *found["template"].outputs]
        )
        for piece, graph in graphs.items():
            if isinstance(graph, RefineGraph | MaskGraph):
                found[piece] = _shapes(graph, graph.input_shapes)
    return found


def _shapes(graph: InferenceGraph, inputs: Iterable[Shape]) -> PieceShapes:
    inputs = list(inputs)
    results = graph(*map(torch.zeros, inputs))
    outputs = (results,) if isinstance(results, Tensor) else results
    return PieceShapes(inputs, [tuple(each.shape) for each in outputs])
