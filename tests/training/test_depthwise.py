"""Gradients of depthwise convolutions are those of PyTorch."""

import pytest

torch = pytest.importorskip("torch")

import torch.nn.functional as F  # noqa: E402

from ssiam.training.depthwise import FastDepthwiseGradients  # noqa: E402

FAST = "_DepthwiseBackward"


def gradients(inputs, gradient, **options):
    result = F.conv2d(*inputs, **options)
    return type(result.grad_fn).__name__, torch.autograd.grad(result, inputs, gradient)


def tensors(images, channels, side, kernel, groups=None):
    torch.manual_seed(0)
    shapes = [
        (images, channels, side, side),
        (channels, channels // (groups or channels), kernel, kernel),
        (channels,),
    ]
    return [torch.randn(shape, requires_grad=True) for shape in shapes]


@pytest.mark.parametrize("kernel", [4, 5])
@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("padding", [0, 2, (1, 2)])
def test_gradients_are_equal(kernel, stride, padding):
    inputs = tensors(600, 4, 15, kernel)  # in several chunks
    options = {"stride": stride, "padding": padding, "groups": 4}
    gradient = torch.randn_like(F.conv2d(*inputs, **options))
    name, expected = gradients(inputs, gradient, **options)
    assert name != FAST
    with FastDepthwiseGradients():
        name, found = gradients(inputs, gradient, **options)
    assert name == FAST
    for ours, theirs in zip(found, expected, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=0.02)


@pytest.mark.parametrize(
    ("kernel", "groups", "options"),
    [(3, 8, {}), (5, 4, {}), (5, 8, {"dilation": 2}), (5, 8, {"padding": "same"})],
)
def test_other_convolutions_are_pytorchs(kernel, groups, options):
    inputs = tensors(1, 8, 15, kernel, groups)
    with FastDepthwiseGradients():
        assert type(F.conv2d(*inputs, groups=groups, **options).grad_fn).__name__ != FAST
        with torch.no_grad():
            assert F.conv2d(*inputs, groups=groups, **options).grad_fn is None


def test_autocast_is_applied():
    inputs = tensors(2, 8, 15, 5)
    with FastDepthwiseGradients(), torch.autocast("cpu", torch.bfloat16):
        result = F.conv2d(*inputs, groups=8)
    assert result.dtype == torch.bfloat16
    found = torch.autograd.grad(result.float().square().sum(), inputs)
    expected = torch.autograd.grad(F.conv2d(*inputs, groups=8).square().sum(), inputs)
    for ours, theirs in zip(found, expected, strict=True):
        assert ours.dtype == torch.float32
        assert torch.cosine_similarity(ours.flatten(), theirs.flatten(), dim=0) > 0.999
