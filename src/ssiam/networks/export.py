"""Networks split into pieces for inference, and their export to ONNX.

A piece takes and returns tensors only. `template` runs once per target, `search` once per frame,
and `refine` or `mask` for the chosen cell only.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

import torch
from torch import Tensor, nn

from ssiam.errors import MissingExtraError
from ssiam.networks.base import SiameseNetwork
from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.siammask import SiamMask, SiamMaskBase

__all__ = [
    "InferenceGraph",
    "MaskGraph",
    "RefineGraph",
    "SearchGraph",
    "TemplateGraph",
    "inference_graphs",
    "write_onnx",
]


class TemplateGraph(nn.Module):
    """Template crop (1, 3, 127, 127) -> kernels, named as the network's `kernel_names`.

    Threads: inference may run in any number at once, training in one.
    """

    input_names: tuple[str, ...] = ("template_crop",)

    def __init__(self, network: SiameseNetwork) -> None:
        super().__init__()
        self.network = network
        self.output_names = network.kernel_names

    def forward(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Kernels of a template crop."""
        return self.network.template(crop)


class SearchGraph(nn.Module):
    """Search crop and kernels -> responses, named as the network's `response_names`.

    Threads: inference may run in any number at once, training in one.

    Parameters
    ----------
    network : SiameseNetwork
    sliced : bool
        Compute correlations as sums of slices, which every runtime accepts, and not as
        convolutions whose weights are inputs, which are faster in PyTorch.
    """

    def __init__(self, network: SiameseNetwork, *, sliced: bool = True) -> None:
        super().__init__()
        self.network = network
        self.input_names = ("search_crop", *network.kernel_names)
        self.output_names = network.response_names
        self._sliced = sliced

    def forward(self, crop: Tensor, *kernels: Tensor) -> tuple[Tensor, ...]:
        """Responses of a search crop to the kernels."""
        return self.network.search(crop, kernels, sliced=self._sliced)


class MaskGraph(nn.Module):
    """Correlation (1, 256, n, n) -> mask logits (1, 3969, n, n), 63 x 63 per cell; n may be 1.

    Threads: inference may run in any number at once, training in one.
    """

    input_shapes = ((1, 256, 1, 1),)
    input_names: tuple[str, ...] = ("corr",)
    output_names: tuple[str, ...] = ("logits",)

    def __init__(self, network: SiamMaskBase) -> None:
        super().__init__()
        self.network = network

    def forward(self, corr: Tensor) -> Tensor:
        """Mask logits of the cells of a correlation."""
        return self.network.masks(corr)


class RefineGraph(nn.Module):
    """Patches of the search features around one cell -> mask logits (1, 16129), 127 x 127.

    Threads: inference may run in any number at once, training in one.

    The patches are x0 (1, 64, 61, 61), p1 (1, 256, 31, 31), p2 (1, 512, 15, 15) and corr
    (1, 256, 1, 1); `ssiam.trackers.siammask` cuts them out.
    """

    input_shapes = ((1, 64, 61, 61), (1, 256, 31, 31), (1, 512, 15, 15), (1, 256, 1, 1))
    input_names: tuple[str, ...] = ("x0", "p1", "p2", "corr")
    output_names: tuple[str, ...] = ("logits",)

    def __init__(self, network: SiamMask) -> None:
        super().__init__()
        self.refine = network.refine_head

    def forward(self, x0: Tensor, p1: Tensor, p2: Tensor, corr: Tensor) -> Tensor:
        """Mask logits (1, 16129) of the cell."""
        logits: Tensor = self.refine(x0, p1, p2, corr)
        return logits


InferenceGraph: TypeAlias = TemplateGraph | SearchGraph | MaskGraph | RefineGraph


def inference_graphs(network: SiameseNetwork, *, sliced: bool = True) -> dict[str, InferenceGraph]:
    """The pieces of a network by name: template, search, and refine or mask for a SiamMask.

    `sliced` is passed to `SearchGraph`.
    """
    graphs: dict[str, InferenceGraph] = {
        "template": TemplateGraph(network),
        "search": SearchGraph(network, sliced=sliced),
    }
    if isinstance(network, SiamMask):
        graphs["refine"] = RefineGraph(network)
    elif isinstance(network, SiamMaskBase):
        graphs["mask"] = MaskGraph(network)
    return graphs


def write_onnx(
    graph: InferenceGraph | BoxMaskNetwork,
    input_shapes: Sequence[tuple[int, ...]],
    path: Path,
    *,
    opset: int,
) -> None:
    """Write a piece as an ONNX file with inputs of fixed shapes.

    Parameters
    ----------
    graph : InferenceGraph or BoxMaskNetwork
        A `SearchGraph` must be sliced, so that every runtime accepts the file.
    input_shapes : sequence of tuple of int
        In the order of `graph.input_names`.
    path : Path
        The file to write.
    opset : int
        Version of the ONNX operator set.

    Raises
    ------
    MissingExtraError
        The package onnx is not installed.
    OSError
        The file cannot be written.
    """
    if find_spec("onnx") is None:
        raise MissingExtraError(
            "the package onnx is not installed, which export to ONNX needs: "
            "pip install 'ssiam[torch]'"
        )
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("ignore")  # tracing warns about shapes, which are fixed here
        torch.onnx.export(
            graph.eval(),
            tuple(map(torch.zeros, input_shapes)),
            str(path),
            dynamo=False,  # the dynamo exporter needs two more packages
            opset_version=opset,
            input_names=list(graph.input_names),
            output_names=list(graph.output_names),
        )
