"""One small protocol for running a network, whatever runs it, and how it is to be run."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral
from typing import Final, Literal, Protocol, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from ssiam.errors import ArgumentError, check_choice

RuntimeName: TypeAlias = Literal["openvino", "onnxruntime", "torch"]
Precision: TypeAlias = Literal["f32", "bf16", "f16", "int8"]
DeviceName: TypeAlias = Literal["cpu", "cuda", "tensorrt", "coreml", "mps"]
Tensor: TypeAlias = NDArray[np.float32]

DEVICES: Final[dict[RuntimeName, tuple[DeviceName, ...]]] = {
    "openvino": ("cpu",),
    "onnxruntime": ("cpu", "cuda", "tensorrt", "coreml"),
    "torch": ("cpu", "cuda", "mps"),
}
PRECISIONS: Final[dict[RuntimeName, tuple[Precision, ...]]] = {
    "openvino": ("f32", "bf16", "int8"),
    "onnxruntime": ("f32", "int8"),
    "torch": ("f32", "bf16", "f16"),
}


class Network(Protocol):
    """A compiled network with fixed input shapes.

    Threads: may be called from any number at once, as trackers of one load share it.
    """

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


@dataclass(frozen=True)
class Running:
    """How networks are run.

    Threads: a value; any number of threads may share it.

    Parameters
    ----------
    runtime : {"openvino", "onnxruntime", "torch"}
    threads : int
        CPU threads of one inference.
    precision : {"f32", "bf16", "f16", "int8"}
        Of the arithmetic; which runtime has which says `PRECISIONS`. "int8" takes files that were
        exported so. Inputs and outputs are float32 with all of them.
    device : {"cpu", "cuda", "tensorrt", "coreml", "mps"}, optional
        Which runtime has which says `DEVICES`; None is the CPU.

    Raises
    ------
    ArgumentError
        An unknown name, or a precision or device that the runtime does not have.
    """

    runtime: RuntimeName = "openvino"
    threads: int = 1
    precision: Precision = "f32"
    device: DeviceName | None = None

    def __post_init__(self) -> None:
        check_choice("runtime", self.runtime, get_args(RuntimeName))
        check_choice("precision", self.precision, get_args(Precision))
        if not isinstance(self.threads, Integral) or self.threads < 1:
            raise ArgumentError(f"threads is {self.threads!r}: it must be a whole number from 1 on")
        self._check_has("precision", self.precision, PRECISIONS[self.runtime])
        self._check_has("device", self.where, DEVICES[self.runtime])
        if self.precision == "f16" and self.where == "cpu":
            raise ArgumentError("precision f16 needs device cuda or mps: take f32 on the CPU")

    @property
    def where(self) -> DeviceName:
        """The device, the CPU if none is named."""
        return self.device or "cpu"

    def _check_has(self, kind: str, value: str, known: tuple[str, ...]) -> None:
        if value not in known:
            raise ArgumentError(
                f"runtime {self.runtime} has no {kind} {value!r}: choose from {', '.join(known)}"
            )
