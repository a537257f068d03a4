"""The weights in the package: training can start from them."""

import json

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from ssiam.runtime import RuntimeOptions  # noqa: E402
from ssiam.runtime.files import sha256  # noqa: E402
from ssiam.trackers.lite import SHIPPED, LiteNetworks  # noqa: E402
from ssiam.training.settings import NetworkSettings, TrainSettings  # noqa: E402
from ssiam.training.students import LiteStudent, MaskStudent  # noqa: E402


def test_training_starts_from_the_network_that_tracks():
    network = LiteStudent(TrainSettings((), network=NetworkSettings(begin="lite"))).network.eval()
    pieces = LiteNetworks.load(SHIPPED, RuntimeOptions())
    random = np.random.default_rng(0)
    template, search = (
        random.uniform(0, 255, (1, 3, side, side)).astype(np.float32) for side in (127, 255)
    )
    kernels = pieces.template(template)
    responses = pieces.responses(search, kernels, kernels[-1])
    with torch.inference_mode():
        ours = network.template(torch.from_numpy(template))
        ours_responses = network.search(torch.from_numpy(search), ours)
    for our, their in zip((*ours, *ours_responses), (*kernels, *responses), strict=True):
        np.testing.assert_allclose(our, their, rtol=1e-3, atol=1e-3)


def test_training_starts_from_the_mask_network_of_the_package():
    """The weights of ImageNet are not needed."""
    settings = NetworkSettings("mask", begin="lite", weights="nowhere.pth")
    network = MaskStudent(TrainSettings((), network=settings)).network.eval()
    mask = LiteNetworks.load(SHIPPED, RuntimeOptions()).mask
    crop = np.random.default_rng(0).uniform(0, 255, (1, 3, 128, 128)).astype(np.float32)
    with torch.inference_mode():
        ours = network(torch.from_numpy(crop))
    np.testing.assert_allclose(ours, mask(crop)[0], rtol=1e-3, atol=1e-3)


def test_network_json_is_of_these_weights():
    record = json.loads((SHIPPED / "network.json").read_text())
    assert record["sha256"] == sha256(SHIPPED / "weights.pth")
