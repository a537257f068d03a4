"""Networks on OpenVINO, the default runtime."""

from __future__ import annotations

import ctypes
import logging
import os
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from itertools import starmap
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ssiam.copying import SharedOnCopy
from ssiam.errors import SinkError, WeightsError
from ssiam.inferences import inference_begins
from ssiam.outputs import make_folder
from ssiam.runtime.files import (
    cache_folder,
    damaged_error,
    input_shape_error,
    not_arrays_error,
    not_int8_error,
    not_run_error,
)
from ssiam.runtime.network import Precision, Tensor
from ssiam.runtime.onnx_files import check_onnx, check_shape
from ssiam.unfinished import staging_folder

# On import OpenVINO sends telemetry from a forked process. Without a network connection that
# process can hang and keep this one from exiting. Without the telemetry package OpenVINO uses a
# stub.
sys.modules.setdefault("openvino_telemetry", None)  # type: ignore[arg-type]

import openvino as ov  # noqa: E402

__all__ = ["CORE", "OpenVinoNetwork", "load_with_shared_weights", "ov", "supports_bf16"]

CORE = ov.Core()
_VERSION: Final = ov.__version__.partition("-")[0]
# What OpenVINO raises for networks that it cannot read or compile
_NATIVE_ERRORS: Final = (RuntimeError, ValueError, TypeError, MemoryError)
_LOG = logging.getLogger(__name__)
_MIN_CACHED_BYTES: Final = 8_000_000  # size of an .onnx file; smaller ones compile fast


class OpenVinoNetwork(SharedOnCopy):
    """The network of an ONNX file, compiled for this CPU.

    Threads: may be called from any number at once; each call has its own inference request.

    Parameters
    ----------
    path : Path
        The .onnx file.
    input_shape : tuple of int, optional
        Replaces the shape of the first input.
    threads : int
        CPU threads of one inference.
    precision : {"f32", "bf16", "int8"}
        "bf16" needs a CPU with AVX-512 or AMX instructions for it; on other CPUs the network runs
        in float32 and a warning is logged. "int8" needs a file that was exported in int8; layers
        that are not quantized run in float32.
    cached : bool
        Cache a large compiled network in the user's cache folder, if that can be written.
    model : openvino.Model, optional
        The content of the file, if it has already been read. The compiled network is then not
        cached.

    Raises
    ------
    WeightsError
        The file is missing, damaged, not ONNX, not in int8, or does not accept `input_shape`.
    """

    _copy_hint = "load it in each process"

    def __init__(
        self,
        path: Path,
        input_shape: tuple[int, ...] | None = None,
        threads: int = 1,
        precision: Precision = "f32",
        *,
        cached: bool = True,
        model: ov.Model | None = None,
    ) -> None:
        self._path = path
        cached = cached and model is None
        model = _read_model(path) if model is None else model
        if input_shape is not None:
            try:
                model.reshape({0: list(input_shape)})
            except RuntimeError as error:
                raise input_shape_error(path, input_shape) from error
        operations = model.get_ops()
        kinds = [each.get_type_name() for each in operations]
        _check_sizes(path, operations, kinds)
        self._convolution_count = sum("Convolution" in kind for kind in kinds)
        if precision == "int8" and not {"FakeQuantize", "QuantizeLinear"} & set(kinds):
            raise not_int8_error(path)
        settings: dict[str, Any] = {
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            # A pinned thread waits for its core even while other cores are free.
            "ENABLE_CPU_PINNING": False,
            "INFERENCE_PRECISION_HINT": _arithmetic(precision),
        }
        cached = cached and path.stat().st_size >= _MIN_CACHED_BYTES
        try:
            self._compiled = _compile(model, settings, cached=cached)
            # Requests not in use. One is created when more calls run at once than ever before.
            self._idle = deque([self._compiled.create_infer_request()])
        except _NATIVE_ERRORS as error:
            raise damaged_error(path) from error
        if not all(map(_is_array, (*self._compiled.inputs, *self._compiled.outputs))):
            raise not_arrays_error(path)
        # Reading these takes .1 ms each time.
        self._input_shapes = [tuple(port.shape) for port in self._compiled.inputs]
        self._input_types = [port.get_element_type().to_dtype() for port in self._compiled.inputs]
        self._output_shapes = [tuple(port.shape) for port in self._compiled.outputs]
        self._output_indices = range(len(self._output_shapes))

    @property
    def input_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the inputs."""
        return list(self._input_shapes)

    @property
    def output_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs."""
        return list(self._output_shapes)

    @property
    def convolution_count(self) -> int:
        """Number of convolutions, including grouped ones."""
        return self._convolution_count

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """New output arrays for float32 inputs."""
        request = self._idle_request()
        try:
            # Passing the arrays to `infer` takes OpenVINO's Python twice as long.
            arrays = list(starmap(_shareable, zip(inputs, self._input_types, strict=True)))
            for index, array in enumerate(arrays):
                request.set_input_tensor(index, ov.Tensor(array, shared_memory=True))
            inference_begins()
            request.infer(share_outputs=True)
            outputs = (request.get_output_tensor(index) for index in self._output_indices)
            return [np.array(tensor.data, dtype=np.float32) for tensor in outputs]
        except _NATIVE_ERRORS as error:
            raise not_run_error(self._path, error) from error
        finally:
            self._idle.append(request)

    def _idle_request(self) -> ov.InferRequest:
        try:
            return self._idle.pop()
        except IndexError:
            return self._compiled.create_infer_request()


def supports_bf16() -> bool:
    """Whether OpenVINO uses bf16 instructions on this CPU."""
    return "BF16" in CORE.get_property("CPU", "OPTIMIZATION_CAPABILITIES")


def _arithmetic(precision: Precision) -> str:
    """OpenVINO's inference precision; by default it would use bf16 on CPUs that support it."""
    if precision == "bf16" and not supports_bf16():
        _LOG.warning("this CPU has no bf16 arithmetic: the network runs in f32")
        return "f32"
    return "bf16" if precision == "bf16" else "f32"


def _compile(model: ov.Model, settings: dict[str, Any], *, cached: bool) -> ov.CompiledModel:
    if cached:
        folder = cache_folder() / "openvino"
        try:
            make_folder(folder)
            return CORE.compile_model(model, "CPU", settings | {"CACHE_DIR": str(folder)})
        except (SinkError, OSError, RuntimeError) as error:
            _LOG.info("compiled networks are not cached in %s: %s", folder, error)
    return CORE.compile_model(model, "CPU", settings)


def _read_model(path: Path) -> ov.Model:
    """The model of an .onnx file; `WeightsError` if it is missing, damaged or not ONNX."""
    check_onnx(path)
    try:
        return CORE.read_model(path)
    except _NATIVE_ERRORS as error:
        raise damaged_error(path) from error


def _check_sizes(path: Path, operations: Sequence[Any], kinds: Sequence[str]) -> None:
    """Refuse a network with a huge array between its inputs and outputs."""
    for operation, kind in zip(operations, kinds, strict=True):
        for port in operation.outputs() if kind != "Constant" else ():
            shape = port.get_partial_shape()
            if shape.is_static:
                try:
                    check_shape(list(shape.to_shape()))
                except ValueError as error:
                    raise WeightsError(f"weights {path} cannot be used: {error}") from None


def _shareable(array: Tensor, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The array, or a copy of it that OpenVINO can use in place."""
    flags = array.flags
    if flags.c_contiguous and flags.writeable and array.dtype == dtype:
        return array
    return np.array(array, dtype=dtype, order="C")


def _is_array(port: Any) -> bool:
    """Whether an input or output has a fixed shape."""
    return bool(port.partial_shape.is_static)


def load_with_shared_weights(
    paths: Sequence[Path], digest: str, threads: int = 1, precision: Precision = "f32"
) -> list[OpenVinoNetwork]:
    """Load networks that have most of their weights in common, with one copy in memory.

    They are cached as one model in the user's cache folder. If that cannot be written, each
    network is loaded separately.

    Parameters
    ----------
    paths : sequence of Path
        The .onnx files.
    digest : str
        Identifies the .onnx files; the cached file is named after it.
    threads, precision
        As in `OpenVinoNetwork`.

    Returns
    -------
    list of OpenVinoNetwork
        In the order of `paths`.

    Raises
    ------
    WeightsError
        As in `OpenVinoNetwork`.
    """
    try:
        joint = _read_joint_model(paths, cache_folder() / "openvino" / f"{digest}-{_VERSION}.xml")
        models = [_extract(joint, number) for number in range(len(paths))]
    except (SinkError, OSError, RuntimeError) as error:
        _LOG.info("networks do not share their weights: %s", error)
        return [OpenVinoNetwork(path, None, threads, precision) for path in paths]
    networks = []
    for path, model in zip(paths, models, strict=True):
        networks.append(OpenVinoNetwork(path, None, threads, precision, model=model))
        _return_freed_memory()
    return networks


def _read_joint_model(paths: Sequence[Path], file: Path) -> ov.Model:
    """The networks as one model, read from `file`, which is written first if necessary."""
    with suppress(RuntimeError):  # missing or damaged
        return CORE.read_model(file)
    make_folder(file.parent)
    with staging_folder(file.parent, ".joint-") as temporary:
        written = temporary / file.name
        ov.serialize(_join([_read_model(path) for path in paths]), written)
        for suffix in (".bin", ".xml"):
            os.replace(written.with_suffix(suffix), file.with_suffix(suffix))
    _return_freed_memory()
    return CORE.read_model(file)


def _join(models: Sequence[ov.Model]) -> ov.Model:
    """One model with all inputs and outputs, whose names get the prefix NUMBER/."""
    for number, model in enumerate(models):
        for node in (*model.get_parameters(), *model.get_results()):
            node.set_friendly_name(f"{number}/{node.get_friendly_name()}")
            node.get_output_tensor(0).set_names(set())
    results = [node for model in models for node in model.get_results()]
    return ov.Model(results, [node for model in models for node in model.get_parameters()])


def _extract(joint: ov.Model, number: int) -> ov.Model:
    """Model `number` of the result of `_join`; its weights are shared."""
    results, parameters = (
        [node for node in nodes if node.get_friendly_name().startswith(f"{number}/")]
        for nodes in (joint.get_results(), joint.get_parameters())
    )
    return ov.Model(results, parameters)


def _return_freed_memory() -> None:
    """Return the memory freed after reading and compiling to the system; glibc would keep it."""
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)
