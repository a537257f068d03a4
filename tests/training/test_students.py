"""Students: a step alone determines what is trained, whatever came before."""

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers import toy_training as toy  # noqa: E402
from ssiam.networks.lite2 import Lite2Network  # noqa: E402
from ssiam.training.settings import NetworkSettings, TrainSettings  # noqa: E402
from ssiam.training.students import Lite2Student, LiteStudent  # noqa: E402

STEM, FROZEN, ALL = 0, 2, 3  # first steps of the phases of `toy.settings`


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return toy.backbone_file(tmp_path_factory.mktemp("weights"))


def lite_student(weights, seed=0):
    torch.manual_seed(seed)
    return LiteStudent(toy.settings(weights))


def values(losses):
    return {name: loss.item() for name, loss in losses.items()}


def copied_state(student):
    return {name: each.clone() for name, each in student.state_dict().items()}


def trained(student):
    """Top-level parts of the network with trained parameters."""
    parameters = student.network.named_parameters()
    return {name.split(".")[0] for name, each in parameters if each.requires_grad}


@pytest.mark.parametrize("step", [STEM, FROZEN, ALL])
def test_losses_do_not_depend_on_the_steps_before(weights, step):
    batch = toy.batch(0, 2)
    direct, student = lite_student(weights), lite_student(weights)
    state = copied_state(student)
    expected = values(direct.losses(batch, step))
    for earlier in (ALL, STEM, FROZEN):
        student.losses(batch, earlier)
        student.load_state_dict(state)  # as batch normalization updates its statistics
        assert values(student.losses(batch, step)) == expected
        assert trained(student) == trained(direct)
        student.load_state_dict(state)
    assert ("stem" in expected) == (step == STEM)


def test_parts_are_frozen_by_step(weights):
    student, batch = lite_student(weights), toy.batch(0, 2)
    backbone = student.network.backbone
    counts = []
    for step in (STEM, FROZEN, ALL):
        student.losses(batch, step)
        counts.append(sum(each.requires_grad for each in backbone.parameters()))
    assert counts[0] == len(list(backbone.stem.parameters()))
    assert counts[1] == 0
    assert counts[2] > counts[0]


def test_loading_a_state_replaces_the_frozen_levels(weights):
    """They run in OpenVINO with the weights of the moment in which they were exported."""
    batch = toy.batch(0, 2)
    student, other = lite_student(weights), lite_student(weights, seed=1)
    state = copied_state(other)
    expected = values(other.losses(batch, FROZEN))
    assert values(student.losses(batch, FROZEN)) != expected
    student.load_state_dict(state)
    assert values(student.losses(batch, FROZEN)) == expected


def test_the_backbone_of_lite2_is_frozen_at_first(tmp_path):
    torch.save(Lite2Network().state_dict(), tmp_path / "lite2.pth")
    network = NetworkSettings("lite2", begin=str(tmp_path / "lite2.pth"), frozen_steps=3)
    student, batch = Lite2Student(TrainSettings((), network=network)), toy.batch(0, 2)
    for step, frozen in ((3, False), (2, True), (3, False)):
        student.losses(batch, step)
        assert ("backbone" in trained(student)) != frozen
