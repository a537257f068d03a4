"""Networks on OpenVINO, the default on a CPU."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from ssiam.errors import WeightsError
from ssiam.runtime.network import Tensor

# Importing OpenVINO reports to a web service from a forked process, unasked, and where there is no
# network that process can hang and keep this one from ending. Without the reporting package
# OpenVINO falls back to a stub of its own.
sys.modules.setdefault("openvino_telemetry", None)  # type: ignore[arg-type]

import openvino as ov  # noqa: E402

_CORE = ov.Core()


class OpenVinoNetwork:
    """An ONNX file compiled for this CPU, in float32.

    Parameters
    ----------
    path : Path
        The .onnx file.
    input_shape : tuple of int, optional
        Shape that the first input is given in place of the file's own.
    threads : int
        CPU threads of one inference.

    Raises
    ------
    WeightsError
        The file is missing, is no ONNX file, or is damaged.
    """

    def __init__(
        self, path: Path, input_shape: tuple[int, ...] | None = None, threads: int = 1
    ) -> None:
        model = _read(path)
        if input_shape is not None:
            try:
                model.reshape({0: list(input_shape)})
            except RuntimeError as error:
                raise WeightsError(
                    f"{path} does not take an input of shape {input_shape}: "
                    "these are weights of another network"
                ) from error
        self._convolutions = sum("Convolution" in op.get_type_name() for op in model.get_ops())
        settings = {
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            "INFERENCE_PRECISION_HINT": "f32",  # the same boxes on every CPU
        }
        self._compiled = _CORE.compile_model(model, "CPU", settings)
        self._request = self._compiled.create_infer_request()

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
        results = self._request.infer(list(inputs), share_inputs=True)
        return [np.array(results[port], dtype=np.float32) for port in self._compiled.outputs]


def _read(path: Path) -> ov.Model:
    if not path.is_file():
        raise WeightsError(f"weights {path} do not exist: give the path of an .onnx file")
    with path.open("rb") as file:
        start = file.read(64).lstrip()
    if start.startswith(b"<"):
        raise WeightsError(
            f"weights {path} are a web page (they start with {start[:14]!r}), "
            "not a network: download the file itself"
        )
    # An ONNX file starts with its ir_version: protobuf field 1, a varint.
    if not start.startswith(b"\x08"):
        raise WeightsError(f"weights {path} are not an ONNX file (they start with {start[:8]!r})")
    try:
        return _CORE.read_model(path)
    except RuntimeError as error:
        size = path.stat().st_size
        raise WeightsError(
            f"weights {path} cannot be read: the file is damaged or cut short ({size} bytes); "
            "download it again"
        ) from error
