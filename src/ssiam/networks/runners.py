"""A network's pieces in PyTorch as functions of NumPy arrays, on a CPU or a GPU."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache, partial
from typing import Any, Final, Literal, NamedTuple, TypeAlias, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.copying import SharedOnCopy
from ssiam.errors import ArgumentError
from ssiam.inferences import inference_begins
from ssiam.networks.checkpoints import Checkpoint
from ssiam.networks.export import InferenceGraph, MaskGraph, RefineGraph, inference_graphs
from ssiam.networks.registry import NetworkName, build_network

__all__ = [
    "GraphRunner",
    "PieceShapes",
    "TorchDevice",
    "TorchPrecision",
    "graph_runners",
    "piece_shapes",
]

Shape: TypeAlias = tuple[int, ...]
TorchDevice: TypeAlias = Literal["cpu", "cuda", "mps"]
TorchPrecision: TypeAlias = Literal["f32", "bf16", "f16"]

_DTYPES: Final = {"f32": torch.float32, "bf16": torch.bfloat16, "f16": torch.float16}


class PieceShapes(NamedTuple):
    """Shapes of a piece's inputs and outputs, in order.

    Threads: a value; any number of threads may share it.
    """

    inputs: list[Shape]
    outputs: list[Shape]


@cache
def piece_shapes(name: NetworkName) -> dict[str, PieceShapes]:
    """Shapes of the pieces of `inference_graphs` by name, without running the network."""
    with torch.device("meta"):
        network = build_network(name)
        graphs = inference_graphs(network)
        shapes = {"template": _graph_shapes(graphs["template"], [network.template_shape])}
        shapes["search"] = _graph_shapes(
            graphs["search"], [network.search_shape, *shapes["template"].outputs]
        )
        for piece, graph in graphs.items():
            if isinstance(graph, RefineGraph | MaskGraph):
                shapes[piece] = _graph_shapes(graph, graph.input_shapes)
    return shapes


class GraphRunner(SharedOnCopy):
    """A piece of a network as a function of NumPy arrays, without gradients.

    Threads: may be called from any number at once; the network keeps nothing between calls.

    Parameters
    ----------
    graph : InferenceGraph
        On the device, in evaluation mode.
    shapes : callable
        Returns the shapes. It is called on demand, because it takes a second.
    device : {"cpu", "cuda", "mps"}
    dtype : torch.dtype
        Data type of the weights. Input and output arrays are always float32.
    """

    _copy_hint = "load it in each process"

    def __init__(
        self,
        graph: InferenceGraph,
        shapes: Callable[[], PieceShapes],
        device: TorchDevice = "cpu",
        dtype: torch.dtype = torch.float32,
    ) -> None:
        self._graph, self._shapes = graph, shapes
        self._device, self._dtype = device, dtype

    @property
    def input_shapes(self) -> list[Shape]:
        """Shapes of the inputs."""
        return self._shapes().inputs

    @property
    def output_shapes(self) -> list[Shape]:
        """Shapes of the outputs."""
        return self._shapes().outputs

    @property
    def convolution_count(self) -> int:
        """Number of convolutions with constant weights in the whole network."""
        kinds = (nn.Conv2d, nn.ConvTranspose2d)
        return sum(isinstance(module, kinds) for module in self._graph.modules())

    def __call__(self, *inputs: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """New output arrays for float32 inputs."""
        with torch.inference_mode():
            tensors = [self._to_device(array) for array in inputs]
            inference_begins()
            results = self._graph(*tensors)
        outputs = (results,) if isinstance(results, Tensor) else results
        return [np.ascontiguousarray(each.float().cpu().numpy()) for each in outputs]

    def _to_device(self, array: NDArray[np.float32]) -> Tensor:
        tensor = torch.from_numpy(array).to(self._device, self._dtype)
        if tensor.ndim != 4:
            return tensor
        return tensor.contiguous(memory_format=torch.channels_last)


def graph_runners(
    checkpoint: Checkpoint,
    *,
    device: TorchDevice = "cpu",
    precision: TorchPrecision = "f32",
    threads: int = 1,
) -> dict[str, GraphRunner]:
    """The pieces of a checkpoint's network by name, as in `inference_graphs`.

    The network is moved to the device and to channels-last order in place.

    Parameters
    ----------
    checkpoint : Checkpoint
    device : {"cpu", "cuda", "mps"}
    precision : {"f32", "bf16", "f16"}
    threads : int
        CPU threads of PyTorch, for the whole process.

    Raises
    ------
    ArgumentError
        The device is not available.
    """
    check_device(device)
    torch.set_num_threads(threads)
    dtype = _DTYPES[precision]
    network = checkpoint.network.to(device, dtype)
    # The overloads of `to` differ between versions of PyTorch.
    cast(Any, network).to(memory_format=torch.channels_last)
    graphs = inference_graphs(network, sliced=False)
    return {
        piece: GraphRunner(graph.eval(), partial(_shapes_of, checkpoint.name, piece), device, dtype)
        for piece, graph in graphs.items()
    }


def _shapes_of(network: NetworkName, piece: str) -> PieceShapes:
    return piece_shapes(network)[piece]


def _graph_shapes(graph: InferenceGraph, inputs: Iterable[Shape]) -> PieceShapes:
    inputs = list(inputs)
    results = graph(*map(torch.zeros, inputs))
    outputs = (results,) if isinstance(results, Tensor) else results
    return PieceShapes(inputs, [tuple(each.shape) for each in outputs])


def check_device(device: TorchDevice) -> None:
    """Raise `ArgumentError` if PyTorch cannot use a device on this machine."""
    available = device == "cpu" or (device == "cuda" and torch.cuda.is_available())
    if not available and not (device == "mps" and torch.backends.mps.is_available()):
        raise ArgumentError(
            f"device {device} is not available in PyTorch {torch.__version__}: "
            "install its build for that device, or omit the device"
        )
