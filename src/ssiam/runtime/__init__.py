"""Running networks: one protocol, chosen by name."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

from ssiam.errors import check_choice
from ssiam.runtime.network import Network, RuntimeName, Tensor

__all__ = ["Network", "RuntimeName", "Tensor", "load_network"]


def load_network(
    path: Path,
    input_shape: tuple[int, ...] | None = None,
    *,
    runtime: RuntimeName = "openvino",
    threads: int = 1,
) -> Network:
    """Network of an .onnx file, compiled for `threads` CPU threads.

    `input_shape` replaces the shape of the first input. Raises `WeightsError` for files that are
    missing or damaged, `ValueError` for an unknown runtime.
    """
    check_choice("runtime", runtime, get_args(RuntimeName))
    from ssiam.runtime.openvino import OpenVinoNetwork

    return OpenVinoNetwork(path, input_shape, threads)
