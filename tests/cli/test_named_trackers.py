"""``--tracker package.module:Class`` on the command line."""

import os
import subprocess
import sys

import pytest

from helpers.foreign_package import write_package
from helpers.tracked_clip import BOX, box_of
from ssiam.cli import main


@pytest.fixture
def others(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    yield write_package(tmp_path)
    sys.modules.pop("others_trackers", None)


def test_a_class_tracks_a_clip_from_the_command_line(others, clip, tmp_path):
    command = [sys.executable, "-m", "ssiam", "track", str(clip[0]), "--box", box_of(BOX), "--end"]
    command += ["3", "--tracker", f"{others}:Still", "--results", "out.csv"]
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 5
    assert done.stderr.count("not a calibrated probability") == 1
    assert f"the score of {others}:Still is its own" in done.stderr


@pytest.mark.parametrize("command", ["track", "live", "trax"])
@pytest.mark.parametrize(
    ("tracker", "message"),
    [
        ("no_such_package:A", "there is no module no_such_package"),
        ("others_trackers:Nothing", "has no Nothing; it has Still"),
        ("others_trackers:Broken", "no such device"),
    ],
)
def test_a_class_that_cannot_be_loaded_is_one_line(
    others, clip, tmp_path, monkeypatch, capsys, command, tracker, message
):
    monkeypatch.chdir(tmp_path)
    if command == "trax":
        pytest.importorskip("trax")
        arguments = []
    else:
        arguments = [str(clip[0]), "--box", box_of(BOX)]
        arguments += ["--headless", "--results", "x.csv"] if command == "live" else []
    assert main([command, *arguments, "--tracker", tracker]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["tune", "DATA", "--out", "o", "--trackers", "others_trackers:Still"],
        ["tune", "DATA", "--out", "o", "--weights", "others_trackers:Still=w"],
        ["vot-workspace", "ws", "--trackers", "others_trackers:Still"],
        [
            "bench",
            "DATA",
            "--out",
            "o",
            "--preset",
            "table1",
            "--trackers",
            "others_trackers:Still",
        ],
        ["weights", "import", "w.pth", "--tracker", "others_trackers:Still"],
    ],
)
def test_commands_that_write_or_read_names_refuse_classes(others, tmp_path, monkeypatch, arguments):
    """Their names end in files, or come from them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "DATA").mkdir()
    (tmp_path / "w.pth").write_bytes(b"")
    assert main(arguments) == 2
    assert others not in sys.modules


def test_a_benchmark_runs_a_class(others, tmp_path):
    from helpers.shaky_dataset import write_dataset

    data, out = write_dataset(tmp_path / "data", sequences=1, frames=4), tmp_path / "out"
    tracker = f"{others}:Still"
    assert (
        main(["bench", str(data), "--out", str(out), "--trackers", tracker, "--stabilize", "off"])
        == 0
    )
    assert [path.name for path in out.iterdir()] == ["others_trackers.Still-off"]
    assert len(list(out.rglob("*_001.txt"))) == 1
