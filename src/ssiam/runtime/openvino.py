"""Networks on OpenVINO, the default on a CPU."""

from __future__ import annotations

import logging
import sys
from collections import deque
from pathlib import Path
from typing import Any, Final

import numpy as np

from ssiam.copying import SharedOnCopy
from ssiam.runtime.files import cache_folder, check_onnx, damaged, misshapen, not_quantised
from ssiam.runtime.network import Precision, Tensor

# Importing OpenVINO reports to a web service from a forked process, unasked, and where there is no
# network that process can hang and keep this one from ending. Without the reporting package
# OpenVINO falls back to a stub of its own.
sys.modules.setdefault("openvino_telemetry", None)  # type: ignore[arg-type]

import openvino as ov  # noqa: E402

__all__ = ["CORE", "OpenVinoNetwork", "computes_in_bf16", "ov", "read_model"]

CORE = ov.Core()
_LOG = logging.getLogger(__name__)
_WORTH_CACHING: Final = 8_000_000  # bytes of an .onnx file; smaller ones compile in no time


class OpenVinoNetwork(SharedOnCopy):
    """An ONNX file compiled for this CPU.

    Threads: may be called from any number at once; each call has an inference request to itself.

    Parameters
    ----------
    path : Path
        The .onnx file.
    input_shape : tuple of int, optional
        Shape that the first input is given in place of the file's own.
    threads : int
        CPU threads of one inference.
    precision : {"f32", "bf16", "int8"}
        "bf16" needs a CPU with AVX-512 or AMX for it; on others it is float32, with a warning in
        the log. "int8" asks for a file that was exported so; its other layers run in float32.
    cached : bool
        Keep a large network compiled in the user's cache folder, if that can be written.
    model : openvino.Model, optional
        What the file holds, if it has been read; it is not kept compiled then.

    Raises
    ------
    WeightsError
        The file is missing, is no ONNX file, is damaged, or is not in int8.
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
        cached = cached and model is None
        model = read_model(path) if model is None else model
        if input_shape is not None:
            try:
                model.reshape({0: list(input_shape)})
            except RuntimeError as error:
                raise misshapen(path, input_shape) from error
        kinds = [op.get_type_name() for op in model.get_ops()]
        self._convolutions = sum("Convolution" in kind for kind in kinds)
        if precision == "int8" and not {"FakeQuantize", "QuantizeLinear"} & set(kinds):
            raise not_quantised(path)
        settings: dict[str, Any] = {
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            # A pinned thread waits for its core while another process has it, and others are free.
            "ENABLE_CPU_PINNING": False,
            "INFERENCE_PRECISION_HINT": _arithmetic(precision),
        }
        cached = cached and path.stat().st_size >= _WORTH_CACHING
        self._compiled = _compiled(model, settings, cached=cached)
        # Requests that no call is using: as many as there have been calls at once.
        self._idle = deque([self._compiled.create_infer_request()])

    @property
    def input_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the inputs."""
        return [tuple(port.shape) for port in self._compiled.inputs]

    @property
    def output_shapes(self) -> list[tuple[int, ...]]:
        """Shapes of the outputs."""
        return [tuple(port.shape) for port in self._compiled.outputs]

    @property
    def convolutions(self) -> int:
        """How many convolutions the file has, grouped ones included."""
        return self._convolutions

    def __call__(self, *inputs: Tensor) -> list[Tensor]:
        """Outputs for float32 inputs, copied."""
        request = self._free_request()
        try:
            results = request.infer(list(inputs), share_inputs=True, share_outputs=True)
            return [np.array(results[port], dtype=np.float32) for port in self._compiled.outputs]
        finally:
            self._idle.append(request)

    def _free_request(self) -> ov.InferRequest:
        try:
            return self._idle.pop()
        except IndexError:
            return self._compiled.create_infer_request()


def computes_in_bf16() -> bool:
    """Whether this CPU has bf16 arithmetic that OpenVINO uses."""
    return "BF16" in CORE.get_property("CPU", "OPTIMIZATION_CAPABILITIES")


def _arithmetic(precision: Precision) -> str:
    """OpenVINO's name of the arithmetic; float32 gives the same boxes on every CPU."""
    if precision == "bf16" and not computes_in_bf16():
        _LOG.warning("this CPU has no bf16 arithmetic: the network runs in f32")
        return "f32"
    return "bf16" if precision == "bf16" else "f32"


def _compiled(model: ov.Model, settings: dict[str, Any], *, cached: bool) -> ov.CompiledModel:
    if cached:
        folder = cache_folder() / "openvino"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            return CORE.compile_model(model, "CPU", settings | {"CACHE_DIR": str(folder)})
        except (OSError, RuntimeError) as error:
            _LOG.info("compiled networks are not kept in %s: %s", folder, error)
    return CORE.compile_model(model, "CPU", settings)


def read_model(path: Path) -> ov.Model:
    """The model of an .onnx file, or a `WeightsError`."""
    check_onnx(path)
    try:
        return CORE.read_model(path)
    except RuntimeError as error:
        raise damaged(path) from error
