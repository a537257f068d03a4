"""NanoTrack v3 in PyTorch: the authors' network, its normalizations folded."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from torch import nn  # noqa: E402

from helpers.synthetic import generator  # noqa: E402
from ssiam.networks.lite2 import Lite2Network  # noqa: E402
from ssiam.networks.nanotrack import folded  # noqa: E402
from ssiam.networks.starting_weights import load_lite2  # noqa: E402
from ssiam.runtime import Running  # noqa: E402
from ssiam.trackers.nanotrack import NanoTrackNetworks  # noqa: E402


def crop(seed, side):
    return generator(seed).integers(0, 256, (1, 3, side, side)).astype(np.float32)


@pytest.mark.parametrize("bias", [False, True])
def test_a_normalization_is_folded_into_the_convolution_before_it(bias):
    torch.manual_seed(0)
    layers = nn.Sequential(nn.Conv2d(3, 5, 3, bias=bias), nn.BatchNorm2d(5), nn.ReLU())
    norm = layers[1]
    for values in (norm.weight.data, norm.bias.data, norm.running_mean):
        values.normal_()
    norm.running_var.uniform_(0.1, 3)
    without = nn.Sequential(nn.Conv2d(3, 5, 3), nn.Identity(), nn.ReLU())
    without.load_state_dict(folded(layers.state_dict()))
    pixels = torch.randn(2, 3, 9, 9)
    with torch.no_grad():
        torch.testing.assert_close(without(pixels), layers.eval()(pixels))


@pytest.mark.parametrize("attention", [0, 2])
def test_the_untrained_network_is_nanotrack_v3(shared, attention):
    folder = shared("data/weights/nanotrackv3")
    network = Lite2Network(attention).eval()
    load_lite2(network, folder / "nanotrackv3.pth")
    theirs = NanoTrackNetworks.load("nanotrack_v3", folder, Running())
    template, search = crop(1, 127), crop(2, 255)
    (kernel,), (features,) = theirs.template(template), theirs.search(search)
    scores, distances = theirs.head(kernel, features)
    with torch.inference_mode():
        ours = network(torch.from_numpy(template), torch.from_numpy(search))
    assert np.abs(ours.score[0, 0].numpy() - (scores[0, 1] - scores[0, 0])).max() < 1e-3
    np.testing.assert_allclose(ours.distances.numpy(), distances, rtol=1e-4, atol=1e-3)
    assert not ours.quality.any()
