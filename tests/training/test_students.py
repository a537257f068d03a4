"""Students: a step alone determines what is trained, whatever came before."""

import pytest

torch = pytest.importorskip("torch")

from helpers import toy_training as toy  # noqa: E402
from ssiam.errors import WeightsError  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.training.settings import NetworkSettings  # noqa: E402
from ssiam.training.students import LiteStudent  # noqa: E402

FROZEN, ALL = 2, 3  # steps before and after the backbone is trained in `toy.settings`


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return toy.weights_file(tmp_path_factory.mktemp("weights"))


def trained(student):
    """Parts of the network with trained parameters."""
    parameters = student.network.named_parameters()
    return {name.split(".")[0] for name, each in parameters if each.requires_grad}


def test_losses_and_trained_parts_do_not_depend_on_the_steps_before(weights):
    batch = toy.batch(0, 2)
    direct, student = (LiteStudent(toy.settings(weights)) for _ in range(2))
    expected = {name: loss.item() for name, loss in direct.losses(batch, ALL).items()}
    for step in (ALL, FROZEN, ALL):
        losses = student.losses(batch, step)
        assert {name: loss.item() for name, loss in losses.items()} == expected
        assert ("backbone" in trained(student)) == (step == ALL)
    assert trained(student) == trained(direct)


def test_layers_up_to_stride_8_are_never_trained(weights):
    student = LiteStudent(toy.settings(weights))
    student.losses(toy.batch(0, 2), ALL)
    backbone = student.network.backbone
    upper = {id(each) for each in backbone.upper_parameters()}
    assert all(each.requires_grad == (id(each) in upper) for each in backbone.parameters())
    assert 0 < len(upper) < len(list(backbone.parameters()))


def test_the_attention_is_that_of_the_settings(weights, tmp_path):
    torch.save(LiteNetwork(0).state_dict(), tmp_path / "without.pth")
    network = NetworkSettings(begin=str(tmp_path / "without.pth"), attention=0)
    assert not LiteStudent(toy.settings(weights, network=network)).network.relation.blocks
    with pytest.raises(WeightsError, match="neither this network's nor NanoTrack v3's"):
        LiteStudent(toy.settings(tmp_path / "without.pth"))
