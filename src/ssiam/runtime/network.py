"""The protocol of a compiled network, and the options for running one."""

from __future__ import annotations

import os
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

_THREADS: Final = 64

DEVICES: Final[dict[RuntimeName, tuple[DeviceName, ...]]] = {
    "openvino": ("cpu",),
    "onnxruntime": ("cpu", "cuda", "tensorrt", "coreml"),
    "torch": ("cpu", "cuda", "mps"),
}
"""Devices of each runtime."""

PRECISIONS: Final[dict[RuntimeName, tuple[Precision, ...]]] = {
    "openvino": ("f32", "bf16", "int8"),
    "onnxruntime": ("f32", "int8"),
    "torch": ("f32", "bf16", "f16"),
}
"""Precisions of each runtime."""


def max_threads() -> int:
    """The most threads of one inference: four for each core, and 64 on any machine."""
    return max(4 * (os.cpu_count() or 1), _THREADS)


class Network(Protocol):
    """A compiled network with fixed input shapes.

    Threads: may be called from any number at once, because trackers of one load share it.
    """

    @property
    def input_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the inputs, in order."""

    @property
    def output_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs, in order."""

    @property
    def convolution_count(self) -> int:
        """Number of convolutions; it distinguishes networks with the same input shapes."""

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """New output arrays for float32 inputs."""


@dataclass(frozen=True)
class RuntimeOptions:
    """How to run a network.

    Threads: a value; any number of threads may share it.

    Parameters
    ----------
    runtime : {"openvino", "onnxruntime", "torch"}
    threads : int
        CPU threads of one inference.
    precision : {"f32", "bf16", "f16", "int8"}
        Precision of the arithmetic; `PRECISIONS` lists those of each runtime. "int8" needs files
        that were exported in int8. Inputs and outputs are always float32.
    device : {"cpu", "cuda", "tensorrt", "coreml", "mps"}, optional
        `DEVICES` lists those of each runtime; None is the CPU.

    Raises
    ------
    ArgumentError
        An unknown name, fewer than 1 thread, or a precision or device that the runtime does not
        support.
    """

    runtime: RuntimeName = "openvino"
    threads: int = 1
    precision: Precision = "f32"
    device: DeviceName | None = None

    def __post_init__(self) -> None:
        check_choice("runtime", self.runtime, get_args(RuntimeName))
        check_choice("precision", self.precision, get_args(Precision))
        if not isinstance(self.threads, Integral) or self.threads < 1:
            raise ArgumentError(f"threads is {self.threads!r}: give a whole number of at least 1")
        if self.threads > max_threads():
            raise ArgumentError(f"threads is {self.threads}: give at most {max_threads()}")
        self._check_supported("precision", self.precision, PRECISIONS[self.runtime])
        self._check_supported("device", self.resolved_device, DEVICES[self.runtime])
        if self.precision == "f16" and self.resolved_device == "cpu":
            raise ArgumentError("precision f16 needs device cuda or mps: use f32 on the CPU")

    @property
    def resolved_device(self) -> DeviceName:
        """The device; the CPU if `device` is None."""
        return self.device or "cpu"

    def _check_supported(self, kind: str, value: str, known: tuple[str, ...]) -> None:
        if value not in known:
            raise ArgumentError(
                f"runtime {self.runtime} has no {kind} {value!r}: choose from {', '.join(known)}"
            )
