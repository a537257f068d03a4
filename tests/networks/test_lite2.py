"""The second network of `lite`: what attention does, and that exported pieces do the same."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from ssiam.errors import WeightsError  # noqa: E402
from ssiam.networks.lite2 import Lite2Network  # noqa: E402
from ssiam.networks.starting_weights import load_lite2  # noqa: E402
from ssiam.runtime import Running  # noqa: E402
from ssiam.trackers.lite2 import Lite2Networks  # noqa: E402
from ssiam.training.checkpoints import write_network  # noqa: E402


def stirred(attention=2):
    """A network whose attention blocks have weights."""
    torch.manual_seed(0)
    network = Lite2Network(attention).eval()
    with torch.no_grad():
        for parameter in network.relation.parameters():
            parameter.normal_(std=0.15)
    return network


def crops(seed, count=1):
    torch.manual_seed(seed)
    return torch.rand(count, 3, 127, 127) * 255, torch.rand(count, 3, 255, 255) * 255


@torch.inference_mode()
def test_attention_begins_with_nothing():
    torch.manual_seed(0)
    network = Lite2Network(2).eval()
    alone = Lite2Network(0).eval()
    alone.load_state_dict(network.state_dict(), strict=False)
    for ours, theirs in zip(network(*crops(1)), alone(*crops(1)), strict=True):
        torch.testing.assert_close(ours, theirs)


@torch.inference_mode()
def test_pairs_of_a_batch_know_nothing_of_each_other():
    network, (template, search) = stirred(), crops(2, 3)
    together = network(template, search)
    for index in range(3):
        alone = network(template[index : index + 1], search[index : index + 1])
        for ours, theirs in zip(alone, together, strict=True):
            torch.testing.assert_close(ours[0], theirs[index], rtol=1e-3, atol=1e-3)


@torch.inference_mode()
def test_the_first_template_is_recent_where_no_other_is_given():
    network, (template, search) = stirred(), crops(3)
    kernels = network.template(template)
    first = network.search(search, kernels)
    again = network.search(search, (*kernels, kernels[-1]))
    for ours, theirs in zip(first, again, strict=True):
        torch.testing.assert_close(ours, theirs)


@torch.inference_mode()
def test_the_recent_template_counts():
    relation = stirred().relation
    first, other = (relation.template(torch.randn(1, 96, 8, 8))[1] for _ in range(2))
    features = torch.randn(1, 96, 16, 16)
    change = relation(features, first, other) - relation(features, first, first)
    assert change.abs().mean() > 1e-4


@torch.inference_mode()
def test_the_parts_of_the_search_region_know_of_each_other():
    """A thing far away changes what is seen here: it may be a distractor."""
    relation = stirred().relation
    context = relation.template(torch.randn(1, 96, 8, 8))[1]
    features = torch.randn(1, 96, 16, 16)
    altered = features.clone()
    altered[:, :, 12:, 12:] = 3 * torch.randn(1, 96, 4, 4)
    change = relation(altered, context, context) - relation(features, context, context)
    assert change[:, :, :4, :4].abs().mean() > 1e-4


@pytest.mark.parametrize("attention", [0, 2])
def test_exported_pieces_do_the_same(tmp_path, attention):
    network, (template, search) = stirred(attention), crops(6)
    write_network(network, tmp_path)
    pieces = Lite2Networks.load(tmp_path, Running())
    with torch.inference_mode():
        kernels = network.template(template)
        wanted = network.search(search, kernels)
    found = pieces.template(template.numpy())
    assert [each.shape for each in found] == [tuple(each.shape) for each in kernels]
    responses = pieces.responses(search.numpy(), found, found[-1])
    for ours, theirs in zip(responses, wanted, strict=True):
        np.testing.assert_allclose(ours, theirs.numpy(), rtol=1e-2, atol=1e-2)


def test_other_weights_are_refused(tmp_path):
    torch.save({"ban_head.odd": torch.zeros(1)}, tmp_path / "other.pth")
    with pytest.raises(WeightsError, match="neither this network's nor NanoTrack v3's"):
        load_lite2(Lite2Network(), tmp_path / "other.pth")
