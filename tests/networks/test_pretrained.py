"""Initial weights: channel order of ImageNet's weights, and refused files."""

import pytest

torch = pytest.importorskip("torch")

from ssiam.errors import WeightsError  # noqa: E402
from ssiam.networks.backbones.efficientnet_lite import EfficientNetLite0  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.networks.pretrained import load_imagenet, load_lite  # noqa: E402


def test_published_weights_take_rgb_and_ours_bgr(tmp_path):
    published = EfficientNetLite0().state_dict()
    torch.save({**published, "_fc.bias": torch.zeros(1000)}, tmp_path / "w.pth")
    backbone = EfficientNetLite0()
    load_imagenet(backbone, tmp_path / "w.pth")
    ours = backbone.state_dict()
    assert torch.equal(ours["_conv_stem.weight"], published["_conv_stem.weight"].flip(1))
    assert torch.equal(ours["_blocks.8._bn2.bias"], published["_blocks.8._bn2.bias"])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        pytest.param({"_conv_stem.weight": torch.zeros(1)}, "not those of Effi", id="another"),
        pytest.param(None, "are damaged", id="truncated"),
    ],
)
def test_wrong_imagenet_weights_are_refused(tmp_path, content, message):
    path = tmp_path / "w.pth"
    torch.save(content or EfficientNetLite0().state_dict(), path)
    if content is None:
        path.write_bytes(path.read_bytes()[:100_000])
    with pytest.raises(WeightsError, match=message) as caught:
        load_imagenet(EfficientNetLite0(), path)
    assert "\n" not in str(caught.value)


def test_wrong_lite_weights_are_refused(tmp_path):
    torch.save({"ban_head.odd": torch.zeros(1)}, tmp_path / "other.pth")
    with pytest.raises(WeightsError, match="neither this network's nor NanoTrack v3's"):
        load_lite(LiteNetwork(), tmp_path / "other.pth")
