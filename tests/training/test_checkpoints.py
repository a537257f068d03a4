"""Which run a folder may resume, and checkpoints of earlier versions."""

import json
import lzma
from dataclasses import replace

import pytest

torch = pytest.importorskip("torch")

from helpers import toy_training as toy  # noqa: E402
from ssiam.errors import ArgumentError, WeightsError  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.training.checkpoints import (  # noqa: E402
    CHECKPOINT,
    read_checkpoint,
    write_checkpoint,
    write_network_so_far,
)
from ssiam.training.data.registry import SourceSettings  # noqa: E402
from ssiam.training.settings import (  # noqa: E402
    NetworkSettings,
    TeacherSettings,
    TrainSettings,
)
from ssiam.training.trainer import Trainer, load_optimizer  # noqa: E402

SOURCE = SourceSettings("davis", "somewhere")
SETTINGS = TrainSettings((SOURCE, SourceSettings("voc", "elsewhere")), teacher=TeacherSettings("t"))


@pytest.fixture
def folder(tmp_path):
    write_checkpoint(tmp_path, SETTINGS, {"step": 6})
    return tmp_path


@pytest.mark.parametrize(
    ("changes", "difference"),
    [
        ({"batch": 7}, "(batch is 32 there and 7 here)"),
        ({"sources": (SOURCE,)}, "(sources are 2 there and 1 here)"),
        (
            {"sources": (replace(SOURCE, weight=2.5), *SETTINGS.sources[1:])},
            "(sources[0].weight is 1.0 there and 2.5 here)",
        ),
    ],
)
def test_only_the_first_difference_is_reported(folder, changes, difference):
    with pytest.raises(ArgumentError) as caught:
        read_checkpoint(folder, replace(SETTINGS, **changes))
    assert difference in str(caught.value)
    assert len(str(caught.value)) < 200 + len(str(folder))


def test_the_number_of_workers_may_change(folder):
    assert read_checkpoint(folder, replace(SETTINGS, workers=0)) == {"step": 6}


def rewrite_settings(folder, change):
    path = folder / CHECKPOINT
    content = torch.load(path, weights_only=True)
    values = json.loads(content["settings"])
    change(values)
    torch.save({**content, "settings": json.dumps(values)}, path)


def test_a_run_older_than_a_setting_is_resumed(folder):
    rewrite_settings(folder, lambda values: values["sources"][0].pop("rivals"))
    assert read_checkpoint(folder, SETTINGS) == {"step": 6}


def test_a_run_of_a_former_network_is_another_run(folder):
    def change(values):
        values["network"].update(blocks=9, light=True)
        values["losses"]["mask"] = 1.0

    rewrite_settings(folder, change)
    with pytest.raises(ArgumentError, match=r"losses.mask is 1.0 there and None here"):
        read_checkpoint(folder, SETTINGS)


def test_a_setting_of_a_later_version_is_a_difference(folder):
    rewrite_settings(folder, lambda values: values["sources"][0].update(shadows=0.5))
    with pytest.raises(ArgumentError, match=r"sources\[0\].shadows is 0.5 there and None here"):
        read_checkpoint(folder, SETTINGS)


NETWORKS = {
    "lite": NetworkSettings(begin="lite2.pth", frozen_steps=2),
    "mask": NetworkSettings("mask", weights="backbone.pth"),
}


@pytest.fixture
def initial_weights(tmp_path, monkeypatch):
    """The files that the settings of the checkpoints name, in the working directory."""
    monkeypatch.chdir(tmp_path)
    toy.backbone_file(tmp_path)
    torch.save(LiteNetwork().state_dict(), "lite2.pth")


def toy_settings(kind):
    return toy.settings("", network=NETWORKS[kind])


@pytest.mark.parametrize("kind", NETWORKS)
def test_checkpoints_of_earlier_versions_are_resumed(kind, initial_weights, tmp_path, request):
    """They were written after three steps by version 0.1.0; their weights were set to zero."""
    golden = request.config.rootpath / "tests/golden/checkpoints" / f"{kind}.pth.xz"
    (tmp_path / CHECKPOINT).write_bytes(lzma.decompress(golden.read_bytes()))
    settings = toy_settings(kind)
    state = read_checkpoint(tmp_path, settings)
    trainer = Trainer(settings, state)
    assert trainer.step == 3
    resumed = trainer.state()
    assert resumed.keys() == state.keys()
    for part in ("student", "average"):
        assert resumed[part].keys() == state[part].keys()
        assert all(torch.equal(each, state[part][key]) for key, each in resumed[part].items())
    assert resumed["optimiser"].keys() == state["optimiser"].keys()
    assert resumed["optimiser"]["param_groups"] == state["optimiser"]["param_groups"]
    assert resumed["optimiser"]["state"].keys() == state["optimiser"]["state"].keys()
    assert torch.equal(resumed["random"], state["random"])


def test_settings_that_are_nested_deeply(folder):
    path = folder / CHECKPOINT
    content = torch.load(path, weights_only=True)
    for depth in (400, 900):
        torch.save({**content, "settings": f'{{"batch": {"[" * depth}{"]" * depth}}}'}, path)
        with pytest.raises((ArgumentError, WeightsError)) as caught:
            read_checkpoint(folder, SETTINGS)
        assert len(str(caught.value)) < 300 + len(str(folder))


def test_a_run_without_its_average_is_not_written(folder):
    mask = replace(SETTINGS, network=NetworkSettings("mask"), teacher=None)
    for state in ({"step": 6}, {"step": 6, "average": {"x": torch.zeros(1)}}):
        write_checkpoint(folder, mask, state)
        with pytest.raises(WeightsError, match="is damaged: remove it"):
            write_network_so_far(mask, folder, folder / "out")


def _optimizer():
    parameters = list(torch.nn.Linear(3, 2).parameters())
    optimizer = torch.optim.AdamW(parameters, lr=0.1)
    sum(each.sum() for each in parameters).backward()
    optimizer.step()
    return optimizer


def _with_group(state, **changes):
    return {**state, "param_groups": [{**state["param_groups"][0], **changes}]}


def _with_moment(state, name, value):
    return {**state, "state": {**state["state"], 0: {**state["state"][0], name: value}}}


@pytest.mark.parametrize(
    "change",
    [
        lambda state: _with_group(state, betas=("a", "b")),
        lambda state: _with_group(state, eps=float("nan")),
        lambda state: _with_group(state, params=[0, 7]),
        lambda state: _with_moment(state, "exp_avg", torch.zeros(5)),
        lambda state: _with_moment(state, "exp_avg", "text"),
        lambda state: _with_moment(state, "step", torch.zeros(3)),
        lambda state: {**state, "state": {9: state["state"][0]}},
        lambda state: {**state, "param_groups": None},
        lambda state: [],
    ],
)
def test_an_optimizer_of_another_form_is_rejected(change):
    """PyTorch accepted most of them and failed in the next step."""
    optimizer = _optimizer()
    load_optimizer(optimizer, _with_group(optimizer.state_dict(), lr=0.5))
    with pytest.raises(WeightsError, match="another optimizer"):
        load_optimizer(optimizer, change(optimizer.state_dict()))


def test_a_state_of_another_network_is_rejected(initial_weights):
    state = Trainer(toy_settings("mask")).state()
    with pytest.raises(WeightsError, match="the checkpoint is of another network"):
        Trainer(toy_settings("lite"), state)
