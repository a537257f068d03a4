"""Faster weight gradients of depthwise convolutions on CPUs.

oneDNN, which PyTorch uses, has a fast weight gradient for depthwise kernels of up to 3 x 3 px. That
of larger ones takes several times as long per weight, and in bf16 ten times. Here the gradient of a
larger kernel is put together from those of small kernels that cover it, each with the input
shifted (docs/decisions/0015-cost-of-training.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

import torch
import torch.nn.functional as F
from torch import Tensor
from torch.overrides import TorchFunctionMode

__all__ = ["FastDepthwiseGradients"]

# By side of a kernel: side and first rows (or columns) of the small kernels that cover it, px.
_TILES: Final = {4: (2, (0, 2)), 5: (3, (0, 2))}
_CHUNK: Final = 1 << 19  # output values of the images that are processed together: about a cache


class FastDepthwiseGradients(TorchFunctionMode):
    """A context in which depthwise convolutions of 4 x 4 and 5 x 5 px have faster gradients.

    The gradients are those of PyTorch up to rounding. Only the forward pass needs the context.
    """

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Iterable[type],
        args: tuple[Any, ...] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> Any:
        """Replace depthwise convolutions; call any other function."""
        kwargs = kwargs or {}
        if func is torch.conv2d:
            result = _convolution(*args, **kwargs)
            if result is not None:
                return result
        return func(*args, **kwargs)


def _convolution(
    input: Tensor,
    weight: Tensor,
    bias: Tensor | None = None,
    stride: Any = 1,
    padding: Any = 0,
    dilation: Any = 1,
    groups: int = 1,
) -> Tensor | None:
    """The convolution, if it is one with a faster gradient; arguments of `torch.conv2d`."""
    channels, per_group, height, width = weight.shape
    if not (
        torch.is_grad_enabled()
        and weight.requires_grad
        and input.is_cpu
        and (channels, per_group) == (groups, 1)
        and height == width
        and height in _TILES
        and _pair(dilation) == (1, 1)
        and not isinstance(padding, str)
    ):
        return None
    if torch.is_autocast_enabled("cpu"):
        dtype = torch.get_autocast_dtype("cpu")
        input, weight = input.to(dtype), weight.to(dtype)
        bias = None if bias is None else bias.to(dtype)
    convolve: Callable[..., Tensor] = _Depthwise.apply
    return convolve(input, weight, bias, _pair(stride), _pair(padding))


class _Depthwise(torch.autograd.Function):
    """A depthwise convolution."""

    @staticmethod
    def forward(
        ctx: Any,
        input: Tensor,
        weight: Tensor,
        bias: Tensor | None,
        stride: tuple[int, int],
        padding: tuple[int, int],
    ) -> Tensor:
        ctx.save_for_backward(input, weight)
        ctx.stride, ctx.padding = stride, padding
        return F.conv2d(input, weight, bias, stride, padding, groups=len(weight))

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Any:
        (gradient,) = gradients
        input, weight = ctx.saved_tensors
        of_input, of_weight, of_bias, *_ = ctx.needs_input_grad
        return (
            _gradients(gradient, input, weight, ctx.stride, ctx.padding)[0] if of_input else None,
            _weight_gradient(gradient, input, weight, ctx.stride, ctx.padding)
            if of_weight
            else None,
            gradient.sum((0, 2, 3)) if of_bias else None,
            None,
            None,
        )


def _gradients(
    gradient: Tensor,
    input: Tensor,
    weight: Tensor,
    stride: tuple[int, int],
    padding: tuple[int, int],
    mask: tuple[bool, bool, bool] = (True, False, False),
) -> Any:
    """PyTorch's gradients of input, weight and bias; None where `mask` is False."""
    channels = len(weight)
    return torch.ops.aten.convolution_backward(
        gradient, input, weight, None, stride, padding, (1, 1), False, (0, 0), channels, mask
    )


def _weight_gradient(
    gradient: Tensor,
    input: Tensor,
    weight: Tensor,
    stride: tuple[int, int],
    padding: tuple[int, int],
) -> Tensor:
    """The gradient (C, 1, k, k) of the weight, summed over chunks of images in float32."""
    _, channels, height, width = gradient.shape
    side, starts = _TILES[weight.shape[2]]
    small = weight.new_empty(channels, 1, side, side)
    rows, columns = (height - 1) * stride[0] + side, (width - 1) * stride[1] + side
    total = torch.zeros(weight.shape)
    chunk = max(1, _CHUNK // (channels * height * width))
    corners = [(top, left) for top in starts for left in starts]
    sums: list[Tensor | float] = [0.0] * len(corners)
    for first in range(0, len(input), chunk):
        images = F.pad(
            input[first : first + chunk], (padding[1], padding[1], padding[0], padding[0])
        )
        errors = gradient[first : first + chunk]
        for number, (top, left) in enumerate(corners):
            shifted = images[:, :, top : top + rows, left : left + columns]
            shifted = shifted.contiguous(memory_format=torch.channels_last)
            part = _gradients(errors, shifted, small, stride, (0, 0), (False, True, False))[1]
            sums[number] = sums[number] + part.float()
    for (top, left), part in zip(corners, sums, strict=True):
        total[:, :, top : top + side, left : left + side] = part
    return total.to(weight.dtype)


def _pair(value: Any) -> tuple[int, int]:
    return (value, value) if isinstance(value, int) else tuple(value)
