"""`ssiam train --device`: everything of a step is on the device, checkpoints are on the CPU.

PyTorch's device "meta" stands for a GPU: it computes no values, but refuses tensors of the CPU.
"""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from helpers import toy_training as toy  # noqa: E402
from ssiam.cli import main  # noqa: E402
from ssiam.training.data.batches import MaskBatch, TeacherResponses  # noqa: E402
from ssiam.training.settings import NetworkSettings, TeacherSettings  # noqa: E402
from ssiam.training.trainer import Trainer  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore:.*copying from a non-meta parameter")


@pytest.fixture(scope="module")
def lite(tmp_path_factory):
    weights = toy.weights_file(tmp_path_factory.mktemp("weights"))
    return toy.settings(weights, teacher=TeacherSettings("unused"))


@pytest.fixture(scope="module")
def mask(tmp_path_factory):
    weights = toy.backbone_file(tmp_path_factory.mktemp("weights"))
    return toy.settings("", network=NetworkSettings("mask", weights=str(weights)))


def lite_batch():
    responses = TeacherResponses(
        np.full((2, 15, 15), 0.5, np.float32),
        np.ones((2, 4, 15, 15), np.float32),
        np.ones(2, np.float32),
    )
    batch = toy.batch(0, 2)
    return replace(batch, recent=batch.template, teacher=responses)


def mask_batch():
    return MaskBatch(np.ones((2, 3, 128, 128), np.uint8), np.ones((2, 64, 64), np.uint8))


def moments(trainer):
    """The optimizer's tensors except for the numbers of steps, which stay on the CPU."""
    states = trainer._optimizer.state.values()
    return [value for each in states for name, value in each.items() if name != "step"]


@pytest.mark.parametrize("kind", ["lite", "mask"])
def test_a_step_is_on_the_device(kind, request):
    settings = request.getfixturevalue(kind)
    batch = lite_batch() if kind == "lite" else mask_batch()
    trainer = Trainer(settings, device="meta")
    losses = trainer.learn(batch)
    assert ("teacher_box" in losses) == (kind == "lite")
    tensors = [*losses.values(), *moments(trainer), *trainer.average.network.state_dict().values()]
    assert len(tensors) > 100
    assert {each.device.type for each in tensors} == {"meta"}


def test_a_checkpoint_of_the_cpu_is_resumed_on_the_device(lite):
    first = Trainer(lite)
    first.learn(lite_batch())
    resumed = Trainer(lite, first.state(), device="meta")
    assert resumed.step == 1
    assert {each.device.type for each in moments(resumed)} == {"meta"}
    resumed.learn(lite_batch())


def test_a_checkpoint_is_fetched_from_the_device(lite, monkeypatch):
    trainer = Trainer(lite, device="meta")
    trainer.learn(lite_batch())
    # A tensor of "meta" has no values to fetch.
    fetched = torch.Tensor.cpu
    monkeypatch.setattr(
        *(torch.Tensor, "cpu"),
        lambda own: torch.zeros(own.shape, dtype=own.dtype) if own.is_meta else fetched(own),
    )
    state = trainer.state()
    monkeypatch.undo()
    resumed = Trainer(lite, state)
    assert {each.device.type for each in resumed.average.network.state_dict().values()} == {"cpu"}
    assert {each.device.type for each in moments(resumed)} == {"cpu"}


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_missing_device_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lite.toml").write_text('[[sources]]\nlayout = "davis"\npath = "missing"\n')
    assert main(["train", "lite.toml", "--device", "cuda"]) == 2
    error = capsys.readouterr().err
    assert "device cuda is not available" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("kind", ["lite", "mask"])
def test_bf16_changes_the_losses_little(kind, request):
    settings = request.getfixturevalue(kind)
    batch = lite_batch() if kind == "lite" else mask_batch()
    exact, mixed = (Trainer(replace(settings, precision=each)) for each in ("f32", "bf16"))
    expected, found = exact.learn(batch), mixed.learn(batch)
    for name, loss in found.items():
        assert loss.dtype == torch.float32
        assert float(loss) == pytest.approx(float(expected[name]), rel=0.1, abs=0.02)
        assert float(loss) != float(expected[name]) or float(loss) == 0 or name == "quality"
    weights = mixed.average.network.state_dict().values()
    assert {each.dtype for each in weights if each.is_floating_point()} == {torch.float32}
