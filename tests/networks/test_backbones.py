"""EfficientNet-Lite0: levels, receptive fields and folded batch normalization."""

import pytest

torch = pytest.importorskip("torch")

from ssiam.networks.backbones.efficientnet_lite import (  # noqa: E402
    CHANNELS,
    EfficientNetLite0,
)


@pytest.mark.parametrize("side", [127, 255, 256])
def test_shapes_of_the_levels(side):
    levels = EfficientNetLite0().eval()(torch.zeros(1, 3, side, side))
    sides = [-(-side // stride) for stride in (4, 8, 16)]
    assert [tuple(level.shape) for level in levels] == [
        (1, channels, n, n) for channels, n in zip(CHANNELS, sides, strict=True)
    ]


def test_centers_of_the_receptive_fields():
    """Odd sides are padded on both sides by the stem, even ones on the right only."""
    torch.manual_seed(0)
    backbone = EfficientNetLite0().eval().double()
    crop = (torch.rand(1, 3, 255, 255, dtype=torch.double) * 255).requires_grad_()
    for number, (stride, first) in enumerate([(4, 2), (8, 6), (16, 14)]):
        (level,) = backbone(crop)[number : number + 1]
        cell = level.shape[-1] // 2
        (gradient,) = torch.autograd.grad(level[0, :, cell, cell].sum(), crop)
        field = gradient[0].abs().sum(dim=0).sum(dim=0).nonzero()
        assert float(field.min() + field.max()) / 2 == stride * cell + first


class _FixedStatistics(torch.nn.BatchNorm2d):
    """Normalizes with the running statistics even in training mode, where nothing is folded."""

    def forward(self, features):
        mean, variance = self.running_mean, self.running_var
        return torch.nn.functional.batch_norm(
            features, mean, variance, self.weight, self.bias, eps=self.eps
        )


def test_fixed_batch_norms_are_folded_into_the_convolutions():
    torch.manual_seed(0)
    backbone = EfficientNetLite0().double().eval()
    norms = [each for each in backbone.modules() if isinstance(each, torch.nn.BatchNorm2d)]
    for norm in norms:
        for values in (norm.running_mean, norm.running_var, norm.weight.data, norm.bias.data):
            values.uniform_(0.5, 1.5)
    crop = torch.rand(2, 3, 127, 127, dtype=torch.double) * 255

    def levels_and_gradients():
        backbone.zero_grad()
        levels = backbone(crop)
        sum(level.square().mean() for level in levels).backward()
        return [*levels, *(each.grad.clone() for each in backbone.parameters())]

    folded = levels_and_gradients()
    for norm in norms:
        norm.__class__, norm.training = _FixedStatistics, True
    for actual, expected in zip(folded, levels_and_gradients(), strict=True):
        torch.testing.assert_close(actual, expected, rtol=1e-9, atol=1e-9)
