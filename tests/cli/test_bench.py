"""`ssiam bench`: what it prints, and what it says to wrong arguments."""

import pytest

from ssiam.cli import main
from tiny import write_dataset


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return write_dataset(tmp_path_factory.mktemp("tiny"), sequences=2, frames=8)


def test_the_table_tells_of_every_tracker(dataset, tmp_path, capsys):
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--trackers", "kcf"]
    assert main(arguments) == 0
    told = capsys.readouterr().out
    for word in ("kcf-off", "kcf-paper", "2 of 2", str(tmp_path)):
        assert word in told
    assert (tmp_path / "kcf-off" / "baseline" / "clip0" / "clip0_001.txt").is_file()


def test_a_preset_lists_what_is_missing_and_runs_the_rest(dataset, tmp_path, capsys):
    arguments = ["bench", str(dataset), "--out", str(tmp_path), "--preset", "table2"]
    assert main([*arguments, "--trackers", "kcf"]) == 0
    told = capsys.readouterr().out
    assert told.splitlines()[0].startswith("missing: ")
    assert (tmp_path / "kcf-paper-keypoints=gftt" / "baseline").is_dir()


def test_a_failed_run_is_told_and_the_others_are_kept(tmp_path, capsys):
    folder = write_dataset(tmp_path / "data", sequences=2, frames=5)
    (folder / "clip1" / "img" / "0002.jpg").write_bytes(b"")
    out = tmp_path / "out"
    arguments = ["--trackers", "kcf", "--stabilize", "off,paper"]
    assert main(["bench", str(folder), "--out", str(out), *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert "2 of 4 runs have no result" in error
    assert "clip1" in error
    assert len(error.splitlines()) == 1
    assert len(list(out.rglob("clip0_001.txt"))) == 2


WRONG = {
    "no dataset": (["--out", "x"], "no dataset"),
    "no such folder": (["nowhere", "--out", "x"], "nowhere"),
    "weights without a name": (["DATA", "--out", "x", "--weights", "here"], "--weights 'here'"),
    "unknown tracker": (["DATA", "--out", "x", "--trackers", "magic"], "unknown tracker 'magic'"),
    "unknown method": (["DATA", "--out", "x", "--stabilize", "on"], "unknown stabilize 'on'"),
    "unknown preset": (["DATA", "--out", "x", "--preset", "table9"], "unknown preset 'table9'"),
    "no jobs": (["DATA", "--out", "x", "--jobs", "0"], "--jobs 0"),
    "no cluster there": (
        ["DATA", "--out", "x", "--trackers", "kcf", "--cluster", "tcp://127.0.0.1:1"],
        "tcp://127.0.0.1:1",
    ),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_are_told_in_one_line(
    arguments, message, dataset, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    arguments = [str(dataset) if word == "DATA" else word for word in arguments]
    assert main(["bench", *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    assert not any(tmp_path.rglob("*_001.txt"))
