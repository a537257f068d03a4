"""`ssiam vot-workspace`: written files and errors."""

import configparser

import pytest

from helpers.vot_sequences import write_sequence
from ssiam.cli import main

pytest.importorskip("trax")


@pytest.fixture
def sequences(tmp_path):
    write_sequence(tmp_path / "data" / "ants", 90)
    return tmp_path / "data"


def test_sections_and_next_commands(sequences, tmp_path, capsys):
    folder = tmp_path / "my ws"
    arguments = ["--trackers", "csrt,kcf", "--stabilize", "off,paper", "--sequences"]
    assert main(["vot-workspace", str(folder), *arguments, str(sequences)]) == 0
    config = configparser.ConfigParser()
    config.read(folder / "trackers.ini")
    labels = ["csrt-off", "csrt-paper", "kcf-off", "kcf-paper"]
    assert config.sections() == labels
    output = capsys.readouterr().out
    assert "trackers: 4, sequences: 1\n" in output
    assert f"cd '{folder}'" in output
    assert f"vot evaluate {' '.join(labels)}\n" in output
    assert f"vot analysis --name all {' '.join(labels)}\n" in output


def test_sequences_that_are_left_out_are_named(sequences, tmp_path, capsys):
    (sequences / "bag").mkdir()
    arguments = ["--stabilize", "off", "--force", "--sequences", str(sequences)]
    assert main(["vot-workspace", str(tmp_path / "ws"), *arguments]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "bag: left out, has no groundtruth.txt"
    assert lines[1].endswith("sequences: 1")
    write_sequence(sequences / "bag", 90)
    (sequences / "list.txt").write_text("bag\n")
    assert main(["vot-workspace", str(tmp_path / "ws"), *arguments]) == 0
    line = capsys.readouterr().out.splitlines()[0]
    assert line == f"ants: left out, not in {sequences / 'list.txt'}"


def test_sequences_that_cannot_be_read_are_left_out(sequences, tmp_path, capsys):
    write_sequence(sequences / "damaged", 20)
    (sequences / "damaged" / "groundtruth.txt").write_text("1,2\n" * 20)
    (sequences / "pictureless").mkdir()
    (sequences / "pictureless" / "groundtruth.txt").write_text("1,2,3,4\n" * 20)
    arguments = ["--stabilize", "off", "--force", "--sequences", str(sequences)]
    assert main(["vot-workspace", str(tmp_path / "ws"), *arguments]) == 0
    damaged, pictureless, written, *_ = capsys.readouterr().out.splitlines()
    assert damaged.startswith("damaged: left out, ")
    assert "groundtruth.txt" in damaged
    assert pictureless.startswith("pictureless: left out, ")
    assert "images" in pictureless
    assert written.endswith("sequences: 1")
    listed = (tmp_path / "ws" / "sequences" / "list.txt").read_text().split()
    assert listed == [str(sequences / "ants")]
    (sequences / "list.txt").write_text("ants\ndamaged\n")
    assert main(["vot-workspace", str(tmp_path / "ws"), *arguments]) == 2
    assert "damaged" in capsys.readouterr().err


def test_weights_option(sequences, shared, tmp_path):
    weights = shared("data/weights/nanotrackv3")
    arguments = ["--trackers", "nanotrack_v3", "--stabilize", "off", "--sequences", str(sequences)]
    arguments += ["--weights", f"nanotrack_v3={weights}"]
    assert main(["vot-workspace", str(tmp_path / "ws"), *arguments]) == 0
    assert f"--weights {weights}" in (tmp_path / "ws" / "trackers.ini").read_text()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("--trackers", "csrt,magic"), "'magic'", id="unknown tracker"),
        pytest.param(("--stabilize", "off,on"), "'on'", id="unknown stabilization"),
        pytest.param(("--weights", "missing"), "its path", id="weights of no tracker"),
        pytest.param(
            ("--weights", "kcf=missing"), "kcf is not in --trackers", id="another tracker"
        ),
        pytest.param(
            ("--weights", "csrt=missing"), "csrt has no weights", id="weights without a network"
        ),
        pytest.param(("--trackers", "nanotrack_v1"), "needs weights", id="weights not given"),
        pytest.param(("--stack", "No Such"), "No Such", id="no stack"),
        pytest.param(("--sequences", "missing"), "missing", id="no sequences"),
    ],
)
def test_invalid_input_gives_one_line_error_and_no_files(
    sequences, tmp_path, arguments, named, capsys
):
    given = ["--sequences", str(sequences)] if "--sequences" not in arguments else []
    assert main(["vot-workspace", str(tmp_path / "ws"), *given, *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("ssiam: ")
    assert named in captured.err
    assert captured.err.count("\n") == 1
    assert not (tmp_path / "ws").exists()


def test_existing_workspace_needs_force(sequences, tmp_path, capsys):
    command = ["vot-workspace", str(tmp_path / "ws"), "--sequences", str(sequences)]
    assert [main(command), main(command), main([*command, "--force"])] == [0, 2, 0]
    assert "config.yaml exists already: give --force" in capsys.readouterr().err
