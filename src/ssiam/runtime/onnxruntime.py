"""Networks on ONNX Runtime: on a CPU, or on what its other builds support."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from ssiam.copying import SharedOnCopy
from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.runtime.files import check_onnx, damaged, misshapen, not_quantised
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
_BUILDS: Final = {"coreml": "onnxruntime on macOS"}  # the others are in onnxruntime-gpu
_ONLY_ERRORS: Final = 3  # of what it logs to standard error
_STATE: Final = ort.capi.onnxruntime_pybind11_state
_REFUSED: Final = (_STATE.Fail, _STATE.InvalidArgument, _STATE.InvalidGraph, RuntimeError)


class OnnxRuntimeNetwork(SharedOnCopy):
    """An ONNX file in a session of its own.

    Threads: may be called from any number at once; a session keeps nothing between calls.

    Parameters
    ----------
    path : Path
        The .onnx file.
    input_shape : tuple of int, optional
        Shape that the first input is given in place of the file's own.
    threads : int
        CPU threads of one inference.
    precision : {"f32", "int8"}
        "int8" asks for a file that was exported so.
    device : {"cpu", "cuda", "tensorrt", "coreml"}
        What the device cannot do runs on the CPU.

    Raises
    ------
    WeightsError
        The file is missing, is no ONNX file, is damaged, or is not in int8.
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
        self._convolutions = sum(kind in ("Conv", "ConvTranspose") for kind in kinds)
        if precision == "int8" and "QuantizeLinear" not in kinds:
            raise not_quantised(path)
        content = str(path) if input_shape is None else _reshaped(path, model, input_shape)
        options = ort.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.log_severity_level = _ONLY_ERRORS
        # Threads that wait by spinning take the cores from whatever runs beside.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session = ort.InferenceSession(content, options, providers=providers)
        except _REFUSED as error:
            raise damaged(path) from error
        self._names = [each.name for each in self._session.get_inputs()]
        if input_shape is not None:
            self._try_inputs(path, input_shape)

    @property
    def input_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the inputs."""
        return [tuple(each.shape) for each in self._session.get_inputs()]

    @property
    def output_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs."""
        return [tuple(each.shape) for each in self._session.get_outputs()]

    @property
    def convolutions(self) -> int:
        """How many convolutions the file has, grouped ones included."""
        return self._convolutions

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """Outputs for float32 inputs."""
        results = self._session.run(None, dict(zip(self._names, inputs, strict=True)))
        return [np.asarray(each, dtype=np.float32) for each in results]

    def _try_inputs(self, path: Path, shape: tuple[int, ...]) -> None:
        """Run once, for only then is a shape refused that does not fit the weights."""
        try:
            self(*[np.zeros(each, np.float32) for each in self.input_shapes])
        except _REFUSED as error:
            raise misshapen(path, shape) from error


def _providers(device: DeviceName) -> list[str]:
    wanted = _PROVIDERS[device]
    if wanted not in ort.get_available_providers():
        build = _BUILDS.get(device, "onnxruntime-gpu")
        raise ArgumentError(
            f"device {device} is not in the installed ONNX Runtime {ort.__version__}: "
            f"install {build}, or choose device cpu"
        )
    return list(dict.fromkeys([wanted, _PROVIDERS["cpu"]]))


def _read(path: Path) -> Any:
    check_onnx(path)
    try:
        return onnx.load(path)
    except Exception as error:  # protobuf's DecodeError has no public name
        if type(error).__name__ != "DecodeError":
            raise
        raise damaged(path) from error


def _reshaped(path: Path, model: Any, shape: tuple[int, ...]) -> bytes:
    """The model with another shape of its first input; all others follow from it."""
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
        raise misshapen(path, shape) from error
    return bytes(inferred.SerializeToString())
