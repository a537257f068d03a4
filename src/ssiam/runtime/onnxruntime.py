"""Networks on ONNX Runtime, on a CPU or on a device that the installed build supports."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from ssiam.copying import SharedOnCopy
from ssiam.errors import ArgumentError, MissingExtraError, WeightsError
from ssiam.inferences import inference_begins
from ssiam.runtime.files import (
    damaged_error,
    input_shape_error,
    not_arrays_error,
    not_int8_error,
    not_run_error,
)
from ssiam.runtime.network import DeviceName, Precision, Tensor
from ssiam.runtime.onnx_files import check_onnx, check_shape

try:
    import onnx
    import onnxruntime as ort
    from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
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
_SHAPE_BYTES: Final = 4096  # up to which weights may be the shape of another array
_STATE: Final = ort.capi.onnxruntime_pybind11_state
# What ONNX Runtime and onnx raise for networks that they cannot read or run
_LOAD_ERRORS: Final = (
    *(_STATE.Fail, _STATE.InvalidArgument, _STATE.InvalidGraph, _STATE.InvalidProtobuf),
    *(_STATE.NotImplemented, _STATE.RuntimeException, DecodeError),
    *(onnx.checker.ValidationError, onnx.shape_inference.InferenceError),
    *(RuntimeError, ValueError, TypeError, MemoryError),
)


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
        self._path = path
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
        if not all(_is_array(each.shape) for each in self._session.get_inputs()):
            raise not_arrays_error(path)
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
        try:
            named = dict(zip(self._names, inputs, strict=True))
            inference_begins()
            results = self._session.run(None, named)
        except _LOAD_ERRORS as error:
            raise not_run_error(self._path, error) from error
        return [np.asarray(each, dtype=np.float32) for each in results]

    def _check_input_shape(self, path: Path, shape: tuple[int, ...]) -> None:
        """Run once: ONNX Runtime refuses a shape that does not fit the weights only then."""
        try:
            self(*[np.zeros(each, np.float32) for each in self.input_shapes])
        except WeightsError as error:
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
        model = onnx.load(path, load_external_data=False)
        _check_sizes(path, model)
    except _LOAD_ERRORS as error:
        raise damaged_error(path) from error
    return model


def _check_sizes(path: Path, model: Any) -> None:
    """Refuse a network with a huge array between its inputs and outputs."""
    light = onnx.ModelProto()  # without the weights, which inference would copy
    light.ir_version, graph = model.ir_version, model.graph
    light.opset_import.extend(model.opset_import)
    light.graph.name = graph.name
    light.graph.node.extend(graph.node)
    light.graph.input.extend(graph.input)
    light.graph.output.extend(graph.output)
    for weights in graph.initializer:
        if weights.ByteSize() <= _SHAPE_BYTES:
            light.graph.initializer.append(weights)
        else:
            declared = (weights.name, weights.data_type, weights.dims)
            light.graph.input.append(onnx.helper.make_tensor_value_info(*declared))
    inferred = onnx.shape_inference.infer_shapes(light).graph
    for value in (*inferred.value_info, *inferred.output):
        lengths = [each.dim_value for each in value.type.tensor_type.shape.dim]
        try:
            check_shape(lengths)
        except ValueError as error:
            raise WeightsError(f"weights {path} cannot be used: {error}") from None


def _is_array(shape: Sequence[Any]) -> bool:
    """Whether an input has a fixed shape."""
    return all(isinstance(length, int) and length > 0 for length in shape)


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
