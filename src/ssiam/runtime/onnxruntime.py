"""Networks on ONNX Runtime, on a CPU or on a device that the installed build supports."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from ssiam.copying import SharedOnCopy
from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.runtime.files import check_onnx, damaged_error, input_shape_error, not_int8_error
from ssiam.runtime.network import DeviceName, Precision, Tensor

try:
    import onnx
    import onnxruntime as ort
except ModuleNotFoundError as error:
    if error.name not in ("onnx", "onnxruntime"):
        raise
    raise MissingExtraError(
        f"the package {error.name} is not installed, which runtime onnxruntime needs: "
        "pip install 'ssiam[onnxruntime]'"
    ) from error

_PROVIDERS: Final[dict[DeviceName, str]] = {
    "cpu": "CPUExecutionProvider",
    "cuda": "CUDAExecutionProvider",
    "tensorrt": "TensorrtExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
}
_BUILDS: Final = {"coreml": "onnxruntime on macOS"}  # for other devices: onnxruntime-gpu
_ERRORS_ONLY: Final = 3  # lowest severity that is logged to standard error
_STATE: Final = ort.capi.onnxruntime_pybind11_state
_LOAD_ERRORS: Final = (_STATE.Fail, _STATE.InvalidArgument, _STATE.InvalidGraph, RuntimeError)


class OnnxRuntimeNetwork(SharedOnCopy):
    """The network of an ONNX file in an ONNX Runtime session.

    Threads: may be called from any number at once; a session keeps nothing between calls.

    Parameters
    ----------
    path : Path
        The .onnx file.
    input_shape : tuple of int, optional
        Replaces the shape of the first input.
    threads : int
        CPU threads of one inference.
    precision : {"f32", "int8"}
        "int8" needs a file that was exported in int8.
    device : {"cpu", "cuda", "tensorrt", "coreml"}
        Operators that the device does not support run on the CPU.

    Raises
    ------
    WeightsError
        The file is missing, damaged, not ONNX, not in int8, or does not accept `input_shape`.
    ArgumentError
        The installed ONNX Runtime was not built for the device.
    """

    _copy_hint = "load it in each process"

    def __init__(
        self,
        path: Path,
        input_shape: tuple[int, ...] | None = None,
        threads: int = 1,
        precision: Precision = "f32",
        device: DeviceName = "cpu",
    ) -> None:
        providers = _providers(device)
        model = _read(path)
        kinds = [node.op_type for node in model.graph.node]
        self._convolution_count = sum(kind in ("Conv", "ConvTranspose") for kind in kinds)
        if precision == "int8" and "QuantizeLinear" not in kinds:
            raise not_int8_error(path)
        content = str(path) if input_shape is None else _reshaped(path, model, input_shape)
        options = ort.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.log_severity_level = _ERRORS_ONLY
        # Threads that spin while they wait take cores from other processes.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session = ort.InferenceSession(content, options, providers=providers)
        except _LOAD_ERRORS as error:
            raise damaged_error(path) from error
        self._names = [each.name for each in self._session.get_inputs()]
        if input_shape is not None:
            self._check_input_shape(path, input_shape)

    @property
    def input_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the inputs."""
        return [tuple(each.shape) for each in self._session.get_inputs()]

    @property
    def output_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs."""
        return [tuple(each.shape) for each in self._session.get_outputs()]

    @property
    def convolution_count(self) -> int:
        """Number of convolutions, including grouped ones."""
        return self._convolution_count

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """New output arrays for float32 inputs."""
        results = self._session.run(None, dict(zip(self._names, inputs, strict=True)))
        return [np.asarray(each, dtype=np.float32) for each in results]

    def _check_input_shape(self, path: Path, shape: tuple[int, ...]) -> None:
        """Run once: ONNX Runtime refuses a shape that does not fit the weights only then."""
        try:
            self(*[np.zeros(each, np.float32) for each in self.input_shapes])
        except _LOAD_ERRORS as error:
            raise input_shape_error(path, shape) from error


def _providers(device: DeviceName) -> list[str]:
    provider = _PROVIDERS[device]
    if provider not in ort.get_available_providers():
        build = _BUILDS.get(device, "onnxruntime-gpu")
        raise ArgumentError(
            f"device {device} is not in the installed ONNX Runtime {ort.__version__}: "
            f"install {build}, or choose device cpu"
        )
    return list(dict.fromkeys([provider, _PROVIDERS["cpu"]]))


def _read(path: Path) -> Any:
    check_onnx(path)
    try:
        return onnx.load(path)
    except Exception as error:  # protobuf's DecodeError has no public name
        if type(error).__name__ != "DecodeError":
            raise
        raise damaged_error(path) from error


def _reshaped(path: Path, model: Any, shape: tuple[int, ...]) -> bytes:
    """The model with another shape of its first input, and the other shapes inferred."""
    dimensions = model.graph.input[0].type.tensor_type.shape.dim
    for dimension, length in zip(dimensions, shape, strict=True):
        dimension.dim_value = length
    del model.graph.value_info[:]
    for output in model.graph.output:
        for dimension in output.type.tensor_type.shape.dim:
            dimension.Clear()
    try:
        inferred = onnx.shape_inference.infer_shapes(model, strict_mode=True)
    except onnx.shape_inference.InferenceError as error:
        raise input_shape_error(path, shape) from error
    return bytes(inferred.SerializeToString())
