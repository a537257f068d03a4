"""`ssiam tune`: search, resuming, and options for `ssiam track`."""

import shlex
import signal
import subprocess
import sys

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"), sequences=2, frames=12)


@pytest.fixture(scope="module")
def arguments(dataset):
    return [
        *("tune", str(dataset), "--trackers", "kcf"),
        *("--stabilize", "paper", "--parameter", "thx2=2:40"),
    ]


def test_best_options_are_accepted_by_track(dataset, arguments, tmp_path, capsys):
    search = ["--parameter", "keypoints=gftt,direct", "--parameter", "window=2:9"]
    assert main([*arguments, *search, "--out", str(tmp_path), "--trials", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines[:4]] == ["trial 1", "trial 2", "trial 3", "best"]
    source = str(dataset / "clip0" / "img")
    assert lines[-1] == "chosen on clip0, clip1: measure it on other sequences than these 2"
    line = lines[-2].replace("SOURCE", source).replace("X,Y,W,H", "20,40,28,22")
    _, *words = shlex.split(line)
    assert main([*words, "--results", str(tmp_path / "r.csv")]) == 0


def test_the_default_method_is_searched_by_default(dataset, tmp_path, capsys):
    words = ["tune", str(dataset), "--trackers", "kcf", "--out", str(tmp_path), "--trials", "2"]
    assert main(words) == 0
    first, second, *_, line, _ = capsys.readouterr().out.splitlines()
    assert first.endswith("--stabilize predict")
    for name in ("memory", "smoothing", "margin"):
        assert f"--{name} " in second
    assert "--stabilize predict" in line
    assert main([*words, "--stabilize", "paper"]) == 2
    assert "other parameters and stabilize; give another --out" in capsys.readouterr().err


def test_switches_are_options_of_track(dataset, tmp_path, capsys):
    words = ["tune", str(dataset), "--trackers", "kcf", "--out", str(tmp_path), "--trials", "1"]
    assert main([*words, "--parameter", "turn=false", "--parameter", "find=false"]) == 0
    line = capsys.readouterr().out.splitlines()[-2]
    assert line.endswith("--stabilize predict --no-turn --no-find")
    source = str(dataset / "clip0" / "img")
    line = line.replace("SOURCE", source).replace("X,Y,W,H", "20,40,28,22")
    assert main([*shlex.split(line)[1:], "--results", str(tmp_path / "r.csv")]) == 0


def test_killed_search_is_resumed(arguments, tmp_path, capsys):
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    command = [sys.executable, "-m", "ssiam", *arguments, "--out", str(killed), "--trials", "99"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    while not process.stdout.readline().startswith("trial 3:"):
        assert process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    assert main([*arguments, "--out", str(killed), "--trials", "8"]) == 0
    resumed = capsys.readouterr().out.splitlines()
    assert main([*arguments, "--out", str(whole), "--trials", "8"]) == 0
    undisturbed = capsys.readouterr().out.splitlines()
    assert resumed[:8] == undisturbed[:8]


@pytest.mark.parametrize(
    ("more", "named"),
    [
        pytest.param(["--trials", "0"], "--trials 0", id="no trials"),
        pytest.param(["--jobs", "0"], "--jobs 0", id="no jobs"),
        pytest.param(["--trackers", "magic"], "magic", id="unknown tracker"),
        pytest.param(["--trackers", ","], "--trackers", id="no tracker"),
        pytest.param(
            ["--parameter", "thx2=5:50"],
            "--parameter thx2 is given twice",
            id="parameter given twice",
        ),
        pytest.param(["--parameter", "what=1:2"], "what", id="unknown parameter"),
        pytest.param(
            ["--parameter", "margin=0:1"], "not a setting of paper", id="setting of another method"
        ),
        pytest.param(["--weights", "here"], "here", id="weights without a name"),
        pytest.param(["--trackers", "nanotrack_v3"], "needs weights", id="no weights"),
    ],
)
def test_wrong_arguments_give_one_line_error(arguments, tmp_path, more, named, capsys):
    own = [arguments[1], *arguments[4:]] if more[0] == "--trackers" else arguments[1:]
    assert main(["tune", *own, "--out", str(tmp_path), *more]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert named in captured.err
    assert captured.err.count("\n") == 1


def test_missing_dataset_is_named(tmp_path, capsys):
    arguments = [
        "tune",
        str(tmp_path / "missing"),
        "--trackers",
        "kcf",
        "--out",
        str(tmp_path / "o"),
    ]
    assert main(arguments) == 2
    assert "missing" in capsys.readouterr().err


def test_failed_run_stops_the_trial_after_its_other_runs(tmp_path, capsys):
    data = write_dataset(tmp_path / "data", sequences=3, frames=12)
    broken = data / "clip0" / "img" / "0002.jpg"
    content = broken.read_bytes()
    broken.write_bytes(b"")
    words = ["tune", str(data), "--trackers", "kcf", "--parameter", "memory=0:0.9"]
    words += ["--trials", "2"]
    words += ["--out", str(tmp_path / "out")]
    assert main(words) == 3
    error = capsys.readouterr().err
    assert "1 of the 3 runs of a trial failed" in error
    assert "kcf-predict on clip0" in error
    assert len(list((tmp_path / "out").rglob("*_001.txt"))) == 2
    broken.write_bytes(content)
    assert main(words) == 0
    assert capsys.readouterr().out.splitlines()[0].startswith("trial 1:")
