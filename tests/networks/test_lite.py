"""The network of `lite`: its attention, and the exported pieces."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.runtime import RuntimeOptions  # noqa: E402
from ssiam.trackers.lite import LiteNetworks  # noqa: E402
from ssiam.training.checkpoints import write_network  # noqa: E402


def network_with_attention(blocks=2):
    """A network whose attention blocks have random instead of zero weights."""
    torch.manual_seed(0)
    network = LiteNetwork(blocks).eval()
    with torch.no_grad():
        for parameter in network.relation.parameters():
            parameter.normal_(std=0.15)
    return network


def crops(seed, count=1):
    torch.manual_seed(seed)
    return torch.rand(count, 3, 127, 127) * 255, torch.rand(count, 3, 255, 255) * 255


@torch.inference_mode()
def test_untrained_attention_has_no_effect():
    torch.manual_seed(0)
    network = LiteNetwork(2).eval()
    without = LiteNetwork(0).eval()
    without.load_state_dict(network.state_dict(), strict=False)
    for actual, expected in zip(network(*crops(1)), without(*crops(1)), strict=True):
        torch.testing.assert_close(actual, expected)


@torch.inference_mode()
def test_pairs_of_a_batch_are_independent():
    network, (template, search) = network_with_attention(), crops(2, 3)
    batch = network(template, search)
    for index in range(3):
        single = network(template[index : index + 1], search[index : index + 1])
        for actual, expected in zip(single, batch, strict=True):
            torch.testing.assert_close(actual[0], expected[index], rtol=1e-3, atol=1e-3)


@torch.inference_mode()
def test_the_first_template_replaces_a_missing_recent_one():
    network, (template, search) = network_with_attention(), crops(3)
    kernels = network.template(template)
    without = network.search(search, kernels)
    repeated = network.search(search, (*kernels, kernels[-1]))
    for actual, expected in zip(without, repeated, strict=True):
        torch.testing.assert_close(actual, expected)


@torch.inference_mode()
def test_the_recent_template_changes_the_features():
    relation = network_with_attention().relation
    first, other = (relation.template(torch.randn(1, 96, 8, 8))[1] for _ in range(2))
    features = torch.randn(1, 96, 16, 16)
    change = relation(features, first, other) - relation(features, first, first)
    assert change.abs().mean() > 1e-4


@torch.inference_mode()
def test_distant_parts_of_the_search_region_change_the_features():
    """A distant object may be a distractor."""
    relation = network_with_attention().relation
    context = relation.template(torch.randn(1, 96, 8, 8))[1]
    features = torch.randn(1, 96, 16, 16)
    altered = features.clone()
    altered[:, :, 12:, 12:] = 3 * torch.randn(1, 96, 4, 4)
    change = relation(altered, context, context) - relation(features, context, context)
    assert change[:, :, :4, :4].abs().mean() > 1e-4


@pytest.mark.parametrize("attention", [0, 2])
def test_exported_pieces_match_the_network(tmp_path, attention):
    network, (template, search) = network_with_attention(attention), crops(6)
    write_network(network, tmp_path)
    pieces = LiteNetworks.load(tmp_path, RuntimeOptions())
    with torch.inference_mode():
        kernels = network.template(template)
        expected = network.search(search, kernels)
    outputs = pieces.template(template.numpy())
    assert [each.shape for each in outputs] == [tuple(each.shape) for each in kernels]
    responses = pieces.responses(search.numpy(), outputs, outputs[-1])
    for actual, reference in zip(responses, expected, strict=True):
        np.testing.assert_allclose(actual, reference.numpy(), rtol=1e-2, atol=1e-2)
