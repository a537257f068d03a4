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
)
from ssiam.training.data.registry import SourceSettings  # noqa: E402
from ssiam.training.settings import (  # noqa: E402
    NetworkSettings,
    TeacherSettings,
    TrainSettings,
)
from ssiam.training.trainer import Trainer  # noqa: E402

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


def test_a_state_of_another_network_is_rejected(initial_weights):
    state = Trainer(toy_settings("mask")).state()
    with pytest.raises(WeightsError, match="the checkpoint is of another network"):
        Trainer(toy_settings("lite"), state)
