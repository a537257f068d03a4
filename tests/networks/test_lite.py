"""The network of `lite`: output shapes, and the exported pieces."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from ssiam.errors import ArgumentError  # noqa: E402
from ssiam.networks import inference_graphs  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.runtime import load_network  # noqa: E402
from ssiam.training.checkpoints import write_network  # noqa: E402


@pytest.fixture(scope="module", params=[True, False], ids=["light stem", "published stem"])
def network(request):
    torch.manual_seed(0)
    return LiteNetwork(light=request.param).eval()


def test_too_few_blocks_are_refused():
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


def test_exported_pieces_match_the_network(network, tmp_path):
    write_network(network, tmp_path)
    assert sum(path.stat().st_size for path in tmp_path.glob("*.onnx")) < 12e6
    random = np.random.default_rng(0)
    feeds = {"template": [random.uniform(0, 255, (1, 3, 127, 127)).astype(np.float32)]}
    graphs = inference_graphs(network)
    for piece, graph in graphs.items():
        with torch.inference_mode():
            expected = graph(*map(torch.from_numpy, feeds[piece]))
        expected = [expected] if isinstance(expected, torch.Tensor) else expected
        outputs = load_network(tmp_path / f"{piece}.onnx")(*feeds[piece])
        for actual, reference in zip(outputs, expected, strict=True):
            tolerance = 1e-4 * max(1, float(reference.abs().max()))
            assert np.abs(actual - reference.numpy()).max() < tolerance
        if piece == "template":
            crop = random.uniform(0, 255, (1, 3, 255, 255)).astype(np.float32)
            feeds["search"] = [crop, *outputs]
