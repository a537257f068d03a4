"""Pieces of a network as ONNX files."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import torch

from ssiam.errors import MissingExtraError
from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.graphs import InferenceGraph, LowerGraph

__all__ = ["write_onnx"]


def write_onnx(
    graph: InferenceGraph | LowerGraph | BoxMaskNetwork,
    input_shapes: Sequence[tuple[int, ...]],
    path: Path,
    *,
    opset: int,
) -> None:
    """Write a piece with inputs of fixed shapes.

    Parameters
    ----------
    graph : InferenceGraph, LowerGraph or BoxMaskNetwork
        Its correlations sliced, so that every runtime takes the file.
    input_shapes : sequence of tuple of int
    path : Path
    opset : int
        Version of ONNX's set of operators.

    Raises
    ------
    MissingExtraError
        The package onnx is not installed.
    OSError
        The file cannot be written.
    """
    if find_spec("onnx") is None:
        raise MissingExtraError(
            "the package onnx is not installed, which writes networks as ONNX: "
            "pip install 'ssiam[torch]'"
        )
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("ignore")  # of tracing, which is right for fixed shapes
        torch.onnx.export(
            graph.eval(),
            tuple(map(torch.zeros, input_shapes)),
            str(path),
            dynamo=False,  # the other exporter needs two packages more
            opset_version=opset,
            input_names=list(graph.input_names),
            output_names=list(graph.output_names),
        )
