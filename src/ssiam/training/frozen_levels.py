"""Frozen levels of a backbone, run in OpenVINO: it takes a fifth of PyTorch's time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ssiam.networks.backbones.efficientnet_lite import EfficientNetLite0
from ssiam.networks.export import BackboneGraph, write_onnx
from ssiam.outputs import output_error
from ssiam.runtime import Network, Precision, load_network
from ssiam.runtime.manifest import OPSET

__all__ = ["FrozenLevels"]


class FrozenLevels:
    """The first levels of a backbone with its current weights, for crops of given sides.

    Parameters
    ----------
    backbone : EfficientNetLite0
    count : int
        Number of levels, 1 to 3.
    sides : sequence of int
        Sides of the crops, px.
    threads : int
    precision : {"f32", "bf16"}

    Raises
    ------
    SinkError
        The folder of temporary files cannot be written.
    """

    def __init__(
        self,
        backbone: EfficientNetLite0,
        count: int,
        sides: Sequence[int],
        threads: int,
        precision: Precision = "f32",
    ) -> None:
        graph = BackboneGraph(backbone, count)
        self._networks: dict[int, Network] = {}
        for side in sides:
            try:
                with TemporaryDirectory(prefix="ssiam-") as folder:
                    path = Path(folder) / "lower.onnx"
                    write_onnx(graph, [(1, 3, side, side)], path, opset=OPSET)
                    network = load_network(path, threads=threads, precision=precision)
            except OSError as error:
                raise output_error(Path(gettempdir()), error) from error
            self._networks[side] = network

    def __call__(self, crops: NDArray[np.uint8]) -> list[Tensor]:
        """The levels of crops (N, 3, S, S) uint8 BGR, without gradients.

        Crops run one by one, which is fastest on a CPU.
        """
        network = self._networks[crops.shape[-1]]
        by_crop = [network(crop[None].astype(np.float32)) for crop in crops]
        return [
            torch.from_numpy(np.concatenate(level)).contiguous(memory_format=torch.channels_last)
            for level in zip(*by_crop, strict=True)
        ]
