"""NanoTrack v3 in PyTorch: folded batch norms, and the outputs of the authors' ONNX files."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from torch import nn  # noqa: E402

from helpers.seeded_weights import noise_crop  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.networks.nanotrack import fold_batch_norms  # noqa: E402
from ssiam.networks.pretrained import load_lite  # noqa: E402
from ssiam.runtime import RuntimeOptions  # noqa: E402
from ssiam.trackers.nanotrack import NanoTrackNetworks  # noqa: E402


@pytest.mark.parametrize("bias", [False, True])
def test_a_batch_norm_is_folded_into_the_preceding_convolution(bias):
    torch.manual_seed(0)
    layers = nn.Sequential(nn.Conv2d(3, 5, 3, bias=bias), nn.BatchNorm2d(5), nn.ReLU())
    norm = layers[1]
    for values in (norm.weight.data, norm.bias.data, norm.running_mean):
        values.normal_()
    norm.running_var.uniform_(0.1, 3)
    without = nn.Sequential(nn.Conv2d(3, 5, 3), nn.Identity(), nn.ReLU())
    without.load_state_dict(fold_batch_norms(layers.state_dict()))
    pixels = torch.randn(2, 3, 9, 9)
    with torch.no_grad():
        torch.testing.assert_close(without(pixels), layers.eval()(pixels))


@pytest.mark.parametrize("attention", [0, 2])
def test_the_untrained_network_is_nanotrack_v3(shared, attention):
    folder = shared("data/weights/nanotrackv3")
    network = LiteNetwork(attention).eval()
    load_lite(network, folder / "nanotrackv3.pth")
    reference = NanoTrackNetworks.load("nanotrack_v3", folder, RuntimeOptions())
    template, search = noise_crop(1, 127), noise_crop(2, 255)
    (kernel,), (features,) = reference.template(template), reference.search(search)
    scores, distances = reference.head(kernel, features)
    with torch.inference_mode():
        responses = network(torch.from_numpy(template), torch.from_numpy(search))
    assert np.abs(responses.score[0, 0].numpy() - (scores[0, 1] - scores[0, 0])).max() < 1e-3
    np.testing.assert_allclose(responses.distances.numpy(), distances, rtol=1e-4, atol=1e-3)
    assert not responses.quality.any()
