"""Quantization to int8, calibrated on crops of the user's images."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, Final, TypeAlias

import cv2
import numpy as np

from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.runtime.manifest import OPSET
from ssiam.runtime.network import Network, Tensor

__all__ = ["Feed", "calibration_feeds", "quantize"]

Feed: TypeAlias = list[Tensor]
"""Inputs of one run of a network, in order."""

_TEMPLATE: Final = 127  # px, side of a template crop
_CROPS: Final = 32  # calibration runs
_TEMPLATE_SIZES: Final = (0.1, 0.4)  # side of the template region, in the shorter image side
_HEAD: Final = "/head/"  # in the names of the layers after the correlation; they are fast
_PER_CHANNEL_OPSET: Final = 13  # the first opset with scales per channel
_PERCENTILE: Final = 99.99  # percentage of a layer's values within its range
_MAX_OFFSET: Final = 0.25  # target to center of the search region, in the region's side


def calibration_feeds(
    template: Network,
    search_shapes: Sequence[tuple[int, ...]],
    images: Sequence[Tensor | np.ndarray[Any, np.dtype[np.uint8]]],
    *,
    rgb: bool = False,
) -> list[Feed]:
    """Inputs of the search piece: random search crops of the images, and kernels of templates.

    The generator's seed is fixed: the same arguments give the same result.

    Parameters
    ----------
    template : Network
        The template piece: (1, 3, 127, 127) -> kernels.
    search_shapes : sequence of tuple of int
        Shapes of the search piece's inputs: (N, 3, S, S) of the crops, then those of the kernels.
        One more is the last kernel of a recent template, or fewer if it does not use the last one.
    images : sequence of (H, W, 3) uint8 BGR
    rgb : bool
        Whether the network takes RGB crops.

    Returns
    -------
    list of Feed
        Inputs of 32 runs: crops (N, 3, S, S) float32 in 0..255, then the kernels. The recent
        template is the first one.

    Raises
    ------
    ArgumentError
        There are no images.
    """
    if not images:
        raise ArgumentError("no images to calibrate on: give a video or a folder of images")
    random = np.random.default_rng(0)
    count, _, side, _ = search_shapes[0]
    feeds = []
    for i in range(_CROPS):
        image = images[i * len(images) // _CROPS]
        image = image[..., ::-1] if rgb else image
        height, width = image.shape[:2]
        template_side = random.uniform(*_TEMPLATE_SIZES) * min(height, width)
        center_xy = random.uniform((0, 0), (width, height))
        kernels = template(_crop(image, center_xy, template_side, _TEMPLATE))
        search_side = template_side * side / _TEMPLATE
        offsets = random.uniform(-_MAX_OFFSET, _MAX_OFFSET, (count, 2)) * search_side
        crops = [_crop(image, center_xy + offset, search_side, side) for offset in offsets]
        feeds.append([np.concatenate(crops), *kernels, kernels[-1]][: len(search_shapes)])
    return feeds


def quantize(source: Path, target: Path, feeds: Sequence[Feed]) -> None:
    """Write an .onnx file with int8 convolutions up to the correlation.

    Depthwise convolutions stay in float32, because their quantization costs the most accuracy. In
    a network with depthwise convolutions the outputs of convolutions stay in float32 as well. In
    other networks they are quantized, because ONNX Runtime is not faster otherwise.

    The range of a layer contains nearly all values of the calibration runs. Weights have a scale
    per channel and 7 bits, because CPUs without AVX-512 VNNI add two 8-bit products in 16 bits.
    Both OpenVINO and ONNX Runtime run the file.

    Parameters
    ----------
    source : Path
        The float32 .onnx file. An opset without scales per channel is converted to `OPSET`.
    target : Path
        The file to write.
    feeds : sequence of Feed
        Inputs of the calibration runs.

    Raises
    ------
    MissingExtraError
        ONNX Runtime is not installed.
    """
    try:
        from onnxruntime.quantization import (
            CalibrationMethod,
            QuantFormat,
            QuantType,
            quantize_static,
        )
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"the package {error.name} is not installed, which export to int8 needs: "
            "pip install 'ssiam[onnxruntime]'"
        ) from error

    model = _read_per_channel(source)
    depthwise = _depthwise_layers(model.graph)
    logging.getLogger().addFilter(_is_not_advice)
    try:
        with redirect_stdout(None):  # quantize_static prints its settings
            quantize_static(
                model,
                str(target),
                _FeedReader(model.graph, feeds),
                quant_format=QuantFormat.QDQ,
                op_types_to_quantize=["Conv"],
                nodes_to_exclude=depthwise + _head_layers(model.graph),
                per_channel=True,
                reduce_range=True,
                activation_type=QuantType.QUInt8,
                weight_type=QuantType.QInt8,
                calibrate_method=CalibrationMethod.Percentile,
                extra_options={
                    "CalibPercentile": _PERCENTILE,
                    # One run at a time: the values of all layers in all runs do not fit in memory.
                    "CalibStridedMinMax": 1,
                    "OpTypesToExcludeOutputQuantization": ["Conv"] if depthwise else [],
                },
            )
    finally:
        logging.getLogger().removeFilter(_is_not_advice)


def _read_per_channel(path: Path) -> Any:
    """The model of an .onnx file, in an opset with scales per channel."""
    import onnx

    model = onnx.load(path)
    opset = next(entry.version for entry in model.opset_import if not entry.domain)
    if opset < _PER_CHANNEL_OPSET:
        model = onnx.version_converter.convert_version(model, OPSET)
    return model


def _depthwise_layers(graph: Any) -> list[str]:
    """Names of the depthwise convolutions: their kernels have one input channel."""
    input_channels = {w.name: w.dims[1] for w in graph.initializer if len(w.dims) == 4}
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    return [
        node.name
        for node in convolutions
        if input_channels.get(node.input[1]) == 1 and _HEAD not in node.name
    ]


def _head_layers(graph: Any) -> list[str]:
    """Names of the layers after the correlation."""
    return [node.name for node in graph.node if _HEAD in node.name]


class _FeedReader:
    """The feeds with the interface of ONNX Runtime's `CalibrationDataReader`."""

    def __init__(self, graph: Any, feeds: Sequence[Feed]) -> None:
        constants = {weight.name for weight in graph.initializer}
        self._names = [entry.name for entry in graph.input if entry.name not in constants]
        self._feeds = feeds
        self._remaining: Iterator[Feed] = iter(feeds)

    def __len__(self) -> int:
        return len(self._feeds)

    def set_range(self, start_index: int, end_index: int) -> None:
        """Restrict `get_next` to this range of the feeds."""
        self._remaining = iter(self._feeds[start_index:end_index])

    def get_next(self) -> dict[str, Tensor] | None:
        """The next inputs by name, None after the last."""
        feed = next(self._remaining, None)
        return None if feed is None else dict(zip(self._names, feed, strict=True))


def _is_not_advice(record: logging.LogRecord) -> bool:
    """A log filter: drops ONNX Runtime's advice to preprocess the model."""
    return "pre-process" not in record.getMessage()


def _crop(image: Any, center_xy: Any, side: float, out: int) -> Tensor:
    """A square of an image as a network input (1, 3, out, out), gray outside the image."""
    scale = side / out
    left, top = center_xy - side / 2
    image_from_crop = np.array([[scale, 0, left], [0, scale, top]])
    crop = cv2.warpAffine(
        np.ascontiguousarray(image),
        image_from_crop,
        (out, out),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(110, 110, 110),
    )
    return np.ascontiguousarray(crop.transpose(2, 0, 1)[None], dtype=np.float32)
