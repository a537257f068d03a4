"""Whole runs on a toy set: losses fall, killed runs resume, and the network tracks."""

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
from helpers.shaky_dataset import write_dataset  # noqa: E402
from helpers.synthetic import golden_video  # noqa: E402
from ssiam.errors import ArgumentError, SinkError, WeightsError  # noqa: E402
from ssiam.networks.lite import LiteNetwork  # noqa: E402
from ssiam.runtime import RuntimeOptions  # noqa: E402
from ssiam.stabilize import FrameView  # noqa: E402
from ssiam.trackers.lite import LiteNetworks, LiteTracker  # noqa: E402
from ssiam.training.checkpoints import (  # noqa: E402
    write_network,
    write_network_so_far,
    write_pth,
)
from ssiam.training.metrics import Metrics  # noqa: E402
from ssiam.training.settings import (  # noqa: E402
    HeldOut,
    NetworkSettings,
    ValidationSettings,
)
from ssiam.training.trainer import Trainer  # noqa: E402


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    return toy.weights_file(tmp_path_factory.mktemp("weights"))


@pytest.fixture(scope="module")
def finished(weights, tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    dataset = write_dataset(tmp_path_factory.mktemp("held-out"), sequences=2, frames=4)
    validation = ValidationSettings((HeldOut(str(dataset), only=("clip0",)),), every=6, frames=3)
    toy.run(folder, weights, validation=validation)
    return folder


def test_the_network_of_the_last_checkpoint_can_be_written(weights, finished, tmp_path):
    assert write_network_so_far(toy.settings(weights), finished, tmp_path / "so-far") == 6
    so_far, whole = (torch.load(each / "weights.pth") for each in (tmp_path / "so-far", finished))
    assert all(torch.equal(so_far[key], whole[key]) for key in whole)
    with pytest.raises(ArgumentError, match="holds no run"):
        write_network_so_far(toy.settings(weights), tmp_path, tmp_path / "so-far")


def rows(folder):
    with (folder / "metrics.csv").open() as file:
        return [(int(row["step"]), row["name"]) for row in csv.DictReader(file)]


def test_a_killed_run_resumes_to_the_same_weights(weights, finished, tmp_path):
    tests = str(Path(__file__).parents[1])
    paths = os.pathsep.join(filter(None, (tests, os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": paths}
    command = [sys.executable, toy.__file__, str(tmp_path), str(weights)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    while process.stdout.readline().strip() != "4":
        assert process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    assert not (tmp_path / "weights.pth").exists()
    toy.run(tmp_path, weights)
    resumed, whole = (torch.load(each / "weights.pth") for each in (tmp_path, finished))
    assert resumed.keys() == whole.keys()
    assert all(torch.equal(resumed[key], whole[key]) for key in whole)
    written = rows(tmp_path)
    assert len(written) == len(set(written))
    assert {step for step, _ in written} == set(range(6))


@pytest.fixture
def small_files():
    """Limit files to 20,000 bytes, as a full disk would."""
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_keeps_the_previous_checkpoint_and_network(tmp_path, small_files):
    for name in ("checkpoint.pth", "weights.pth", "search.onnx", "network.json"):
        (tmp_path / name).write_text("previous")
    with pytest.raises(SinkError, match=r"checkpoint\.pth: cannot be written \(File too large\)"):
        write_pth(tmp_path / "checkpoint.pth", {"weights": torch.zeros(100_000)})
    with pytest.raises(SinkError, match=r"cannot be written \(File too large\)"):
        write_network(LiteNetwork().eval(), tmp_path)
    assert len(list(tmp_path.iterdir())) == 4
    assert {path.read_text() for path in tmp_path.iterdir()} == {"previous"}


def test_a_full_disk_while_metrics_are_written_is_one_error(tmp_path, small_files):
    def write():
        with Metrics(tmp_path) as metrics:
            for step in range(2000):
                metrics.write(step, {"loss": 0.5})

    message = r"metrics\.csv: cannot be written \(File too large\)"
    with pytest.raises(SinkError, match=message) as caught:
        write()
    assert len(str(caught.value).splitlines()) == 1
    assert [step for step, _ in rows(tmp_path)][:3] == [0, 1, 2]


def test_damaged_rows_of_metrics_are_left_out(tmp_path):
    good = "step,name,value\n1,loss,0.5\n"
    odd = "²,loss,1\n" + "9" * 5000 + ',loss,1\n"open,loss,\n\0,\0,\0\n'
    (tmp_path / "metrics.csv").write_bytes((good + odd).encode() + b"\xff,a,b\n")
    with Metrics(tmp_path, 10):
        pass
    assert (tmp_path / "metrics.csv").read_text() == good


def test_metrics_and_validation_are_written(finished):
    written = rows(finished)
    assert [step for step, name in written if name == "score"] == [0, 1, 2, 3, 4, 5]
    assert {name for _, name in written} >= {"score", "box", "quality", "distractor", "success"}
    assert [step for step, name in written if name == "success"] == [5]


def test_the_written_network_tracks(finished):
    networks = LiteNetworks.load(finished, RuntimeOptions())
    tracker = LiteTracker(networks)
    frames, box = golden_video("A", 3)
    tracker.init(FrameView(frames[0]), box)
    for frame in frames[1:]:
        track = tracker.update(FrameView(frame))
        assert track.mask is None
        assert 0 <= track.score <= 1


def test_a_finished_run_is_not_repeated(weights, finished, capsys):
    toy.run(finished, weights)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("frozen", "share"), [pytest.param(30, 0.8, id="heads"), pytest.param(0, 0.8, id="all")]
)
def test_losses_fall(weights, frozen, share):
    network = NetworkSettings(begin=str(weights), frozen_steps=frozen)
    trainer = Trainer(toy.settings(weights, steps=30, batch=4, network=network))
    losses = [float(sum(trainer.learn(toy.batch(step, 4)).values())) for step in range(30)]
    assert sum(losses[-5:]) < share * sum(losses[:5])


def test_a_run_starts_from_the_weights_of_another(weights, finished):
    theirs = torch.load(finished / "weights.pth")
    settings = NetworkSettings(begin=str(finished / "weights.pth"))
    ours = Trainer(toy.settings(weights, network=settings)).average.network.state_dict()
    assert all(torch.equal(ours[key], theirs[key]) for key in ours)


@pytest.mark.parametrize("kind", ["lite", "mask"])
def test_weights_of_another_network_are_rejected(kind, tmp_path):
    path = str(toy.backbone_file(tmp_path))
    with pytest.raises(WeightsError, match=r"weights .* are (not|neither) ") as caught:
        Trainer(toy.settings("", network=NetworkSettings(kind, begin=path)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        pytest.param({"steps": 7}, ArgumentError, "steps is 6 there and 7 here", id="other"),
        pytest.param({}, WeightsError, "checkpoint .* is damaged", id="damaged"),
    ],
)
def test_a_folder_that_cannot_be_resumed(weights, finished, tmp_path, changes, error, message):
    content = (finished / "checkpoint.pth").read_bytes()
    (tmp_path / "checkpoint.pth").write_bytes(content if changes else content[: len(content) // 2])
    with pytest.raises(error, match=message) as caught:
        toy.run(tmp_path, weights, **changes)
    assert "\n" not in str(caught.value)


def test_a_folder_that_cannot_be_made(weights, tmp_path):
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(SinkError, match="file/run: cannot be written"):
        toy.run(tmp_path / "file" / "run", weights)
