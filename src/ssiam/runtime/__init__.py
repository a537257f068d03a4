"""Running networks: one protocol, chosen by name."""

from __future__ import annotations

from pathlib import Path

from ssiam.errors import WeightsError
from ssiam.runtime.network import (
    DeviceName,
    Network,
    Precision,
    Running,
    RuntimeName,
    Tensor,
)
from ssiam.runtime.published import PUBLISHED, Publication

__all__ = [
    "PUBLISHED",
    "DeviceName",
    "Network",
    "Precision",
    "Publication",
    "Running",
    "RuntimeName",
    "Tensor",
    "load_network",
]


def load_network(
    path: Path,
    input_shape: tuple[int, ...] | None = None,
    *,
    runtime: RuntimeName = "openvino",
    threads: int = 1,
    precision: Precision = "f32",
    device: DeviceName | None = None,
) -> Network:
    """Network of an .onnx file, compiled as `Running` says.

    `input_shape` replaces the shape of the first input. With the same file, float32 results of
    the runtimes differ by less than a thousandth of an output's greatest magnitude.

    Raises
    ------
    ArgumentError
        An unknown runtime, or one without that precision or device.
    MissingExtraError
        The runtime is not installed.
    WeightsError
        The file is missing, damaged or of another kind, or is not in int8 as asked for.
    """
    running = Running(runtime, threads, precision, device)
    if running.runtime == "torch":
        raise WeightsError(
            f"weights {path} are not for PyTorch, which runs the authors' .pth files: "
            "choose runtime openvino or onnxruntime"
        )
    if running.runtime == "onnxruntime":
        from ssiam.runtime.onnxruntime import OnnxRuntimeNetwork

        return OnnxRuntimeNetwork(path, input_shape, threads, precision, running.where)
    from ssiam.runtime.openvino import OpenVinoNetwork

    return OpenVinoNetwork(path, input_shape, threads, precision)
