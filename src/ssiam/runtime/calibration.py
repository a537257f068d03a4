"""Eight-bit networks: the search piece quantised on crops of the user's own pictures."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.runtime.exported import OPSET
from ssiam.runtime.network import Network, Tensor

__all__ = ["Feed", "calibration_feeds", "quantise"]

Feed = list[Tensor]  # inputs of one run, in their order

_TEMPLATE: Final = 127  # px
_CROPS: Final = 32  # runs from which the ranges of the layers are taken
_TARGETS: Final = (0.1, 0.4)  # least and greatest template region, shares of the shorter side
_AFTER_CORRELATION: Final = "/head/"  # layers that cost little, and make the scores and boxes
_CHANNEL_SCALES: Final = 13  # least opset in which weights have a scale for each channel
_PERCENTILE: Final = 99.99  # of a layer's values that its range holds
_FAR: Final = 0.25  # of the search region, by which the target may be off its middle


def calibration_feeds(
    template: Network,
    search_shape: tuple[int, ...],
    pictures: Sequence[Tensor | np.ndarray[Any, np.dtype[np.uint8]]],
    *,
    rgb: bool = False,
) -> list[Feed]:
    """Inputs of the search piece: regions of the pictures, and the kernels of what is in them.

    Parameters
    ----------
    template : Network
        (1, 3, 127, 127) -> kernels.
    search_shape : (N, 3, S, S)
    pictures : sequence of (H, W, 3) uint8 BGR
    rgb : bool
        What the network was trained on.
    """
    if not pictures:
        raise ArgumentError("no pictures to calibrate on: give a video or a folder of pictures")
    random = np.random.default_rng(0)
    count, _, side, _ = search_shape
    feeds = []
    for i in range(_CROPS):
        picture = pictures[i * len(pictures) // _CROPS]
        picture = picture[..., ::-1] if rgb else picture
        height, width = picture.shape[:2]
        region = random.uniform(*_TARGETS) * min(height, width)
        centre = random.uniform((0, 0), (width, height))
        kernels = template(_crop(picture, centre, region, _TEMPLATE))
        wide = region * side / _TEMPLATE
        off = random.uniform(-_FAR, _FAR, (count, 2)) * wide
        crops = [_crop(picture, centre + each, wide, side) for each in off]
        feeds.append([np.concatenate(crops), *kernels])
    return feeds


def quantise(source: Path, target: Path, feeds: Sequence[Feed]) -> None:
    """Write an .onnx file most of whose convolutions compute in eight bits, up to the correlation.

    Depthwise convolutions stay exact, as they lose the most. In a network that has them, what
    comes out of a convolution is exact until it goes into the next: their activations lose much.
    In others it is in eight bits too, without which ONNX Runtime gains no time.

    Ranges of the layers hold nearly all values that the runs show. Weights have a scale for each
    channel and seven bits: CPUs before AVX-512 VNNI sum two products of eight bits in sixteen.
    OpenVINO and ONNX Runtime both take the file.

    Parameters
    ----------
    source : Path
        The .onnx file, of any opset that onnx can raise to one with scales for each channel.
    target : Path
    feeds : sequence of Feed

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

    model = _with_channel_scales(source)
    depthwise = _depthwise(model.graph)
    logging.getLogger().addFilter(_no_advice)
    try:
        with redirect_stdout(None):  # where it tells its own settings
            quantize_static(
                model,
                str(target),
                _Reader(model.graph, feeds),
                quant_format=QuantFormat.QDQ,
                op_types_to_quantize=["Conv"],
                nodes_to_exclude=depthwise + _after_correlation(model.graph),
                per_channel=True,
                reduce_range=True,
                activation_type=QuantType.QUInt8,
                weight_type=QuantType.QInt8,
                calibrate_method=CalibrationMethod.Percentile,
                extra_options={
                    "CalibPercentile": _PERCENTILE,
                    # One run at a time: all layers' values of all runs would fill the memory.
                    "CalibStridedMinMax": 1,
                    "OpTypesToExcludeOutputQuantization": ["Conv"] if depthwise else [],
                },
            )
    finally:
        logging.getLogger().removeFilter(_no_advice)


def _with_channel_scales(path: Path) -> Any:
    """The onnx model, of an opset whose weights may have a scale for each channel."""
    import onnx

    model = onnx.load(path)
    opset = next(each.version for each in model.opset_import if not each.domain)
    if opset < _CHANNEL_SCALES:
        model = onnx.version_converter.convert_version(model, OPSET)
    return model


def _depthwise(graph: Any) -> list[str]:
    """Names of the convolutions with one channel of the input in each kernel."""
    into_each = {each.name: each.dims[1] for each in graph.initializer if len(each.dims) == 4}
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    return [
        node.name
        for node in convolutions
        if into_each.get(node.input[1]) == 1 and _AFTER_CORRELATION not in node.name
    ]


def _after_correlation(graph: Any) -> list[str]:
    """Names of the head's layers."""
    return [node.name for node in graph.node if _AFTER_CORRELATION in node.name]


class _Reader:
    """Hands out the feeds one by one, in ranges, as ONNX Runtime's calibration wants them."""

    def __init__(self, graph: Any, feeds: Sequence[Feed]) -> None:
        constants = {each.name for each in graph.initializer}
        self._names = [each.name for each in graph.input if each.name not in constants]
        self._all = feeds
        self._feeds: Iterator[Feed] = iter(feeds)

    def __len__(self) -> int:
        return len(self._all)

    def set_range(self, start_index: int, end_index: int) -> None:
        """Hand out these feeds next."""
        self._feeds = iter(self._all[start_index:end_index])

    def get_next(self) -> dict[str, Tensor] | None:
        """The next inputs by name, None after the last."""
        feed = next(self._feeds, None)
        return None if feed is None else dict(zip(self._names, feed, strict=True))


def _no_advice(record: logging.LogRecord) -> bool:
    """Keep out the advice to change the model first, which is of no use to the user."""
    return "pre-process" not in record.getMessage()


def _crop(picture: Any, center_xy: Any, side: float, out: int) -> Tensor:
    """Square of a picture as networks take it, (1, 3, out, out); grey where it lies outside."""
    scale = side / out
    left, top = center_xy - side / 2
    picture_from_crop = np.array([[scale, 0, left], [0, scale, top]])
    crop = cv2.warpAffine(
        np.ascontiguousarray(picture),
        picture_from_crop,
        (out, out),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(110, 110, 110),
    )
    return np.ascontiguousarray(crop.transpose(2, 0, 1)[None], dtype=np.float32)
