"""The small network: its backbone's padding and weights, its shapes, its pieces as ONNX."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from ssiam.errors import ArgumentError, WeightsError  # noqa: E402
from ssiam.networks import inference_graphs  # noqa: E402
from ssiam.networks.efficientnet_lite import CHANNELS, EfficientNetLite0  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.networks.starting_weights import load_imagenet  # noqa: E402
from ssiam.runtime import load_network  # noqa: E402
from ssiam.training.checkpoints import write_network  # noqa: E402


@pytest.fixture(scope="module", params=[True, False], ids=["light", "ImageNet's stem"])
def network(request):
    torch.manual_seed(0)
    return LiteNetwork(light=request.param).eval()


@pytest.mark.parametrize("light", [False, True])
@pytest.mark.parametrize("side", [127, 255, 256])
def test_levels_of_the_backbone(side, light):
    levels = EfficientNetLite0(light=light).eval()(torch.zeros(1, 3, side, side))
    sides = [-(-side // stride) for stride in (4, 8, 16)]
    assert [tuple(level.shape) for level in levels] == [
        (1, channels, n, n) for channels, n in zip(CHANNELS, sides, strict=True)
    ]


@pytest.mark.parametrize("light", [False, True])
def test_where_the_features_look(light):
    """The stem of an odd side is padded on both sides, even ones on the right alone."""
    torch.manual_seed(0)
    backbone = EfficientNetLite0(9, light=light).eval().double()
    crop = (torch.rand(1, 3, 255, 255, dtype=torch.double) * 255).requires_grad_()
    for number, (stride, first) in enumerate([(4, 2), (8, 6), (16, 14)]):
        (level,) = backbone(crop)[number : number + 1]
        cell = level.shape[-1] // 2
        (gradient,) = torch.autograd.grad(level[0, :, cell, cell].sum(), crop)
        seen = gradient[0].abs().sum(dim=0).sum(dim=0).nonzero()
        assert float(seen.min() + seen.max()) / 2 == stride * cell + first


def test_the_first_levels_can_be_completed(network):
    crop = torch.rand(1, 3, 127, 127) * 255
    whole = network.backbone(crop)
    for count in (2, 3):  # a light stem makes the first two at once
        levels = network.backbone.completed(network.backbone.lower(crop, count))
        assert all(map(torch.equal, levels, whole))


class _Unfolded(torch.nn.BatchNorm2d):
    """Looks as if it learnt its statistics, and uses those that it has."""

    def forward(self, features):
        mean, variance = self.running_mean, self.running_var
        return torch.nn.functional.batch_norm(
            features, mean, variance, self.weight, self.bias, eps=self.eps
        )


@pytest.mark.parametrize("light", [False, True])
def test_statistics_that_stay_are_part_of_the_convolution(light):
    torch.manual_seed(0)
    backbone = EfficientNetLite0(9, light=light).double().eval()
    norms = [each for each in backbone.modules() if isinstance(each, torch.nn.BatchNorm2d)]
    for norm in norms:
        for values in (norm.running_mean, norm.running_var, norm.weight.data, norm.bias.data):
            values.uniform_(0.5, 1.5)
    crop = torch.rand(2, 3, 127, 127, dtype=torch.double) * 255

    def seen():
        backbone.zero_grad()
        levels = backbone(crop)
        sum(level.square().mean() for level in levels).backward()
        return [*levels, *(each.grad.clone() for each in backbone.parameters())]

    folded = seen()
    for norm in norms:
        norm.__class__, norm.training = _Unfolded, True
    for ours, theirs in zip(folded, seen(), strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-9, atol=1e-9)


def test_a_light_stem_has_no_published_weights(tmp_path):
    theirs = EfficientNetLite0().state_dict()
    torch.save(theirs, tmp_path / "w.pth")
    backbone = EfficientNetLite0(9, light=True)
    before = {key: value.clone() for key, value in backbone.state_dict().items()}
    load_imagenet(backbone, tmp_path / "w.pth")
    for key, value in backbone.state_dict().items():
        assert torch.equal(value, (before if key.startswith("stem.") else theirs)[key])


def test_published_weights_are_of_rgb(tmp_path):
    theirs = EfficientNetLite0().state_dict()
    torch.save({**theirs, "_fc.bias": torch.zeros(1000)}, tmp_path / "w.pth")
    backbone = EfficientNetLite0(9)
    load_imagenet(backbone, tmp_path / "w.pth")
    ours = backbone.state_dict()
    assert torch.equal(ours["_conv_stem.weight"], theirs["_conv_stem.weight"].flip(1))
    assert torch.equal(ours["_blocks.8._bn2.bias"], theirs["_blocks.8._bn2.bias"])


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        pytest.param({"_conv_stem.weight": torch.zeros(1)}, "not those of Effi", id="another"),
        pytest.param(None, "are damaged", id="cut"),
    ],
)
def test_wrong_weights(tmp_path, content, complaint):
    path = tmp_path / "w.pth"
    torch.save(content or EfficientNetLite0().state_dict(), path)
    if content is None:
        path.write_bytes(path.read_bytes()[:100_000])
    with pytest.raises(WeightsError, match=complaint) as caught:
        load_imagenet(EfficientNetLite0(), path)
    assert "\n" not in str(caught.value)


def test_too_few_blocks():
    with pytest.raises(ArgumentError, match="blocks 8 of the backbone: give 9 to 11"):
        LiteNetwork(8)


def test_shapes(network):
    kernel = network.template(torch.rand(2, 3, 127, 127) * 255)[0]
    responses = network.search(torch.rand(2, 3, 255, 255) * 255, [kernel])
    assert kernel.shape == (2, 64, 96)
    assert {name: tuple(value.shape[1:]) for name, value in responses._asdict().items()} == {
        "score": (1, 32, 32),
        "quality": (1, 32, 32),
        "distances": (4, 32, 32),
        "mask": (1, 64, 64),
    }
    assert bool((responses.distances > 0).all())


def test_the_exported_pieces_are_the_network(network, tmp_path):
    write_network(network, tmp_path)
    assert sum(path.stat().st_size for path in tmp_path.glob("*.onnx")) < 12e6
    random = np.random.default_rng(0)
    feeds = {"template": [random.uniform(0, 255, (1, 3, 127, 127)).astype(np.float32)]}
    graphs = inference_graphs(network)
    for piece, graph in graphs.items():
        with torch.inference_mode():
            expected = graph(*map(torch.from_numpy, feeds[piece]))
        expected = [expected] if isinstance(expected, torch.Tensor) else expected
        found = load_network(tmp_path / f"{piece}.onnx")(*feeds[piece])
        for ours, theirs in zip(found, expected, strict=True):
            assert np.abs(ours - theirs.numpy()).max() < 1e-4 * max(1, float(theirs.abs().max()))
        if piece == "template":
            crop = random.uniform(0, 255, (1, 3, 255, 255)).astype(np.float32)
            feeds["search"] = [crop, *found]
