"""Whole runs on a toy set: they learn, they can be killed, and their network tracks."""

import csv
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers import toy_training as toy  # noqa: E402
from helpers.synthetic import golden_video  # noqa: E402
from helpers.tiny_networks import write_dataset  # noqa: E402
from ssiam.errors import ArgumentError, SinkError, WeightsError  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.runtime import Running  # noqa: E402
from ssiam.stabilize import FrameView  # noqa: E402
from ssiam.trackers.lite import LiteNetworks, LiteTracker  # noqa: E402
from ssiam.training.checkpoints import write_file  # noqa: E402
from ssiam.training.finished import write_network, write_so_far  # noqa: E402
from ssiam.training.network_settings import NetworkSettings  # noqa: E402
from ssiam.training.trainer import Trainer  # noqa: E402
from ssiam.training.validation_settings import HeldOut, ValidationSettings  # noqa: E402


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return toy.backbone_file(tmp_path_factory.mktemp("weights"))


@pytest.fixture(scope="module")
def undisturbed(weights, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    dataset = write_dataset(tmp_path_factory.mktemp("held-out"), sequences=2, frames=4)
    validation = ValidationSettings((HeldOut(str(dataset), only=("clip0",)),), every=6, frames=3)
    toy.run(folder, weights, validation=validation)
    return folder


def test_what_a_run_has_learnt_so_far_can_be_tried(weights, undisturbed, tmp_path):
    assert write_so_far(toy.settings(weights), undisturbed, tmp_path / "now") == 6
    now, whole = (torch.load(each / "weights.pth") for each in (tmp_path / "now", undisturbed))
    assert all(torch.equal(now[key], whole[key]) for key in whole)
    with pytest.raises(ArgumentError, match="holds no run"):
        write_so_far(toy.settings(weights), tmp_path, tmp_path / "now")


def rows(folder):
    with (folder / "metrics.csv").open() as file:
        return [(int(row["step"]), row["name"]) for row in csv.DictReader(file)]


def test_a_killed_run_goes_on_to_the_very_same_weights(weights, undisturbed, tmp_path):
    tests = Path(__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": str(tests)}
    command = [sys.executable, toy.__file__, str(tmp_path), str(weights)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    while process.stdout.readline().strip() != "4":
        assert process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    assert not (tmp_path / "weights.pth").exists()
    toy.run(tmp_path, weights)
    resumed, whole = (torch.load(each / "weights.pth") for each in (tmp_path, undisturbed))
    assert resumed.keys() == whole.keys()
    assert all(torch.equal(resumed[key], whole[key]) for key in whole)
    told = rows(tmp_path)
    assert len(told) == len(set(told))
    assert {step for step, _ in told} == set(range(6))


@pytest.fixture
def small_files():
    """No file may grow beyond 20,000 bytes: the disk is as good as full."""
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_keeps_the_older_checkpoint_and_network(tmp_path, small_files):
    for name in ("checkpoint.pth", "weights.pth", "search.onnx", "network.json"):
        (tmp_path / name).write_text("older")
    with pytest.raises(SinkError, match=r"checkpoint\.pth: cannot be written \(File too large\)"):
        write_file(tmp_path / "checkpoint.pth", {"weights": torch.zeros(100_000)})
    with pytest.raises(SinkError, match=r"cannot be written \(File too large\)"):
        write_network(LiteNetwork().eval(), tmp_path)
    assert len(list(tmp_path.iterdir())) == 4
    assert {path.read_text() for path in tmp_path.iterdir()} == {"older"}


def test_metrics_and_validation_are_kept(undisturbed):
    told = rows(undisturbed)
    assert [step for step, name in told if name == "stem"] == [0, 1]
    assert [step for step, name in told if name == "score"] == [2, 3, 4, 5]
    assert {name for _, name in told} >= {"score", "box", "quality", "mask", "success"}
    assert [step for step, name in told if name == "success"] == [5]


def test_the_network_that_is_left_tracks(undisturbed):
    networks = LiteNetworks.load(undisturbed, Running())
    tracker = LiteTracker(networks)
    frames, box = golden_video("A", 3)
    tracker.init(FrameView(frames[0]), box)
    for frame in frames[1:]:
        track = tracker.track(FrameView(frame))
        assert track.mask.shape == frame.shape[:2]
        assert track.corners.shape == (4, 2)
        assert 0 <= track.score <= 1


def test_a_finished_run_is_not_repeated(weights, undisturbed, capsys):
    toy.run(undisturbed, weights)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("network", "share"),
    [
        pytest.param({"light": False, "frozen_steps": 3}, 0.7, id="heads"),
        pytest.param({"stem_steps": 30}, 0.9, id="stem"),
    ],
)
def test_losses_fall(weights, network, share):
    settings = NetworkSettings(weights=str(weights), **network)
    trainer = Trainer(toy.settings(weights, steps=30, batch=4, network=settings))
    losses = [float(sum(trainer.learn(toy.batch(step, 4)).values())) for step in range(30)]
    assert sum(losses[-5:]) < share * sum(losses[:5])


def test_masks_alone_are_learnt(weights, undisturbed):
    """All else, statistics of normalisations too, stays as it was."""
    begin = undisturbed / "weights.pth"
    network = NetworkSettings(weights=str(weights), begin=str(begin), learns="mask")
    trainer = Trainer(toy.settings(weights, steps=30, batch=4, network=network))
    losses = [float(trainer.learn(toy.batch(step, 4))["mask"]) for step in range(30)]
    assert sum(losses[-5:]) < 0.9 * sum(losses[:5])
    before, after = torch.load(begin), trainer.average.network.state_dict()
    changed = {key for key in after if not torch.equal(before[key], after[key])}
    assert changed
    assert all(key.startswith("mask_head.") for key in changed)


def test_a_run_begins_where_another_has_ended(weights, undisturbed):
    """Even if that one had no light stem."""
    theirs = torch.load(undisturbed / "weights.pth")
    settings = NetworkSettings(weights=str(weights), begin=str(undisturbed / "weights.pth"))
    ours = Trainer(toy.settings(weights, network=settings)).average.network.state_dict()
    assert all(torch.equal(ours[key], theirs[key]) for key in ours)


def test_a_run_cannot_begin_with_anything(weights):
    settings = NetworkSettings(weights=str(weights), begin=str(weights))
    with pytest.raises(WeightsError, match="are not those of this network: backbone") as caught:
        Trainer(toy.settings(weights, network=settings))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "error", "complaint"),
    [
        pytest.param({"steps": 7}, ArgumentError, "steps is 6 there and 7 here", id="other"),
        pytest.param({}, WeightsError, "checkpoint .* is damaged", id="damaged"),
    ],
)
def test_a_folder_that_cannot_go_on(weights, undisturbed, tmp_path, changes, error, complaint):
    content = (undisturbed / "checkpoint.pth").read_bytes()
    (tmp_path / "checkpoint.pth").write_bytes(content if changes else content[: len(content) // 2])
    with pytest.raises(error, match=complaint) as caught:
        toy.run(tmp_path, weights, **changes)
    assert "\n" not in str(caught.value)


def test_a_folder_that_cannot_be_made(weights, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(SinkError, match="file/run: cannot be written"):
        toy.run(tmp_path / "file" / "run", weights)
