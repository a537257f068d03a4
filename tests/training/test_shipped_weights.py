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
from ssiam.training.students import LiteStudent  # noqa: E402


def test_training_starts_from_the_network_that_tracks():
    """The weights of ImageNet are not needed."""
    settings = NetworkSettings(weights="nowhere.pth", begin="lite", stem_steps=0, frozen_steps=0)
    network = LiteStudent(TrainSettings((), network=settings)).network.eval()
    pieces = LiteNetworks.load(SHIPPED, RuntimeOptions())
    random = np.random.default_rng(0)
    template, search = (
        random.uniform(0, 255, (1, 3, side, side)).astype(np.float32) for side in (127, 255)
    )
    (kernel,) = pieces.template(template)
    responses = pieces.search(search, kernel)
    with torch.inference_mode():
        ours = network.template(torch.from_numpy(template))
        ours_responses = network.search(torch.from_numpy(search), ours)
    np.testing.assert_allclose(ours[0], kernel, atol=1e-4)
    for our, their in zip(ours_responses, responses, strict=True):
        np.testing.assert_allclose(our, their, rtol=1e-3, atol=1e-3)


def test_network_json_is_of_these_weights():
    record = json.loads((SHIPPED / "network.json").read_text())
    assert record["sha256"] == sha256(SHIPPED / "weights.pth")
