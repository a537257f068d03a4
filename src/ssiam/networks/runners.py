"""A network's pieces in PyTorch as callables on arrays, on a processor or a graphics card."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, Literal, TypeAlias, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.copying import SharedOnCopy
from ssiam.errors import ArgumentError
from ssiam.networks.catalogue import NetworkName
from ssiam.networks.checkpoints import Checkpoint
from ssiam.networks.graphs import InferenceGraph, inference_graphs
from ssiam.networks.shapes import PieceShapes, piece_shapes

__all__ = ["GraphRunner", "TorchDevice", "TorchPrecision", "runners"]

TorchDevice: TypeAlias = Literal["cpu", "cuda", "mps"]
TorchPrecision: TypeAlias = Literal["f32", "bf16", "f16"]

_DTYPES: Final = {"f32": torch.float32, "bf16": torch.bfloat16, "f16": torch.float16}


class GraphRunner(SharedOnCopy):
    """A piece of a network, without gradients.

    Threads: may be called from any number at once; the network keeps nothing between calls.

    Parameters
    ----------
    graph : InferenceGraph
        Already on the device.
    shapes : callable
        Gives the shapes when they are asked for, which takes PyTorch a second.
    device : {"cpu", "cuda", "mps"}
    dtype : torch.dtype
        Of the weights; arrays that go in and come out are float32 whatever it is.
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
    def input_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the inputs."""
        return self._shapes().inputs

    @property
    def output_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs."""
        return self._shapes().outputs

    @property
    def convolutions(self) -> int:
        """Convolutions with constant weights in the whole network that this is a piece of."""
        kinds = (nn.Conv2d, nn.ConvTranspose2d)
        return sum(isinstance(module, kinds) for module in self._graph.modules())

    def __call__(self, *inputs: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        """Outputs for float32 inputs; the arrays are the caller's own."""
        with torch.inference_mode():
            results = self._graph(*[self._placed(array) for array in inputs])
        outputs = (results,) if isinstance(results, Tensor) else results
        return [np.ascontiguousarray(each.float().cpu().numpy()) for each in outputs]

    def _placed(self, array: NDArray[np.float32]) -> Tensor:
        tensor = torch.from_numpy(array).to(self._device, self._dtype)
        if tensor.ndim != 4:
            return tensor
        return tensor.contiguous(memory_format=torch.channels_last)


def runners(
    checkpoint: Checkpoint,
    *,
    device: TorchDevice = "cpu",
    precision: TorchPrecision = "f32",
    threads: int = 1,
) -> dict[str, GraphRunner]:
    """The pieces of a network by name, as `inference_graphs` has them.

    The network itself is moved to the device, in channels-last order.

    Parameters
    ----------
    checkpoint : Checkpoint
    device : {"cpu", "cuda", "mps"}
    precision : {"f32", "bf16", "f16"}
    threads : int
        CPU threads of all that PyTorch computes in this process.

    Raises
    ------
    ArgumentError
        The device is not there.
    """
    _check_device(device)
    torch.set_num_threads(threads)
    dtype = _DTYPES[precision]
    network = checkpoint.network.to(device, dtype)
    # Its overloads differ between versions of PyTorch.
    cast(Any, network).to(memory_format=torch.channels_last)
    graphs = inference_graphs(network, sliced=False)
    return {
        piece: GraphRunner(graph.eval(), partial(_shapes, checkpoint.name, piece), device, dtype)
        for piece, graph in graphs.items()
    }


def _shapes(network: NetworkName, piece: str) -> PieceShapes:
    return piece_shapes(network)[piece]


def _check_device(device: TorchDevice) -> None:
    there = device == "cpu" or (device == "cuda" and torch.cuda.is_available())
    if not there and not (device == "mps" and torch.backends.mps.is_available()):
        raise ArgumentError(
            f"device {device} is not there for PyTorch {torch.__version__}: "
            "install its build for that device, or leave the device out"
        )
