"""Networks in inference pieces: modules that take and give tensors only.

Each becomes an ONNX file of its own. `template` runs once a target, `search` once a frame, and
`refine` or `mask` for the one cell whose mask is wanted.
"""

from __future__ import annotations

from typing import TypeAlias

from torch import Tensor, nn

from ssiam.networks.efficientnet_lite import EfficientNetLite0
from ssiam.networks.siamese import SiameseNetwork
from ssiam.networks.siammask import SiamMask, SiamMaskBase

__all__ = [
    "InferenceGraph",
    "LowerGraph",
    "MaskGraph",
    "RefineGraph",
    "SearchGraph",
    "TemplateGraph",
    "inference_graphs",
]


class TemplateGraph(nn.Module):
    """Template crop (1, 3, 127, 127) -> the kernels of every head, named `kernel_names`.

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
    """Search crop and kernels -> the network's responses, named `response_names`.

    Threads: inference may run in any number at once, training in one.

    Parameters
    ----------
    network : SiameseNetwork
    sliced : bool
        Correlations as sums of slices, which every runtime takes; else convolutions whose weights
        are inputs, which are quicker in PyTorch.
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
    """Correlation (1, 256, n, n) -> mask logits (1, 3969, n, n), 63 x 63 a cell; n may be 1.

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
    """Windows of the search features about one cell -> mask logits (1, 16129), 127 x 127.

    Threads: inference may run in any number at once, training in one.

    The windows are x0 (1, 64, 61, 61), p1 (1, 256, 31, 31), p2 (1, 512, 15, 15) and corr
    (1, 256, 1, 1); `ssiam.trackers.siammask` cuts them.
    """

    input_shapes = ((1, 64, 61, 61), (1, 256, 31, 31), (1, 512, 15, 15), (1, 256, 1, 1))

    input_names: tuple[str, ...] = ("x0", "p1", "p2", "corr")
    output_names: tuple[str, ...] = ("logits",)

    def __init__(self, network: SiamMask) -> None:
        super().__init__()
        self.refine = network.refine_head

    def forward(self, x0: Tensor, p1: Tensor, p2: Tensor, corr: Tensor) -> Tensor:
        """Mask logits of the cell that the windows belong to."""
        logits: Tensor = self.refine(x0, p1, p2, corr)
        return logits


class LowerGraph(nn.Module):
    """Crop (1, 3, S, S) -> the first levels of a backbone: no piece, but what training freezes.

    Parameters
    ----------
    backbone : EfficientNetLite0
    count : int
        Levels, 1 to 3.
    """

    input_names: tuple[str, ...] = ("crop",)

    def __init__(self, backbone: EfficientNetLite0, count: int) -> None:
        super().__init__()
        self.backbone = backbone
        self._count = count
        self.output_names = tuple(f"level{number}" for number in range(count))

    def forward(self, crop: Tensor) -> tuple[Tensor, ...]:
        """The levels of a crop."""
        return tuple(self.backbone.lower(crop, self._count))


InferenceGraph: TypeAlias = TemplateGraph | SearchGraph | MaskGraph | RefineGraph


def inference_graphs(network: SiameseNetwork, *, sliced: bool = True) -> dict[str, InferenceGraph]:
    """The pieces that a tracker runs, by name: template, search, and refine or mask if it has one.

    `sliced` is that of `SearchGraph`.
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
