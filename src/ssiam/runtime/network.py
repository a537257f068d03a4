"""One small protocol for running a network, whatever runs it."""

from __future__ import annotations

from typing import Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

RuntimeName: TypeAlias = Literal["openvino"]
Tensor: TypeAlias = NDArray[np.float32]


class Network(Protocol):
    """A compiled network with fixed input shapes."""

    @property
    def input_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the inputs, in the order in which they are given."""

    @property
    def output_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs, in the order in which they are returned."""

    @property
    def convolutions(self) -> int:
        """How many convolutions it has, by which networks of equal shapes are told apart."""

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """Outputs for float32 inputs; the arrays are the caller's own."""
