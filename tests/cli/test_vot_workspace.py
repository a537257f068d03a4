"""`ssiam vot-workspace` from its arguments to its files."""

import configparser

import pytest

from ssiam.cli import main

pytest.importorskip("trax")


@pytest.fixture
def sequences(tmp_path):
    (tmp_path / "data" / "ants").mkdir(parents=True)
    (tmp_path / "data" / "ants" / "groundtruth.txt").write_text("1,2,3,4\n" * 90)
    return tmp_path / "data"


def test_a_section_for_each_tracker_and_way_and_the_next_commands(sequences, tmp_path, capsys):
    folder = tmp_path / "my ws"
    arguments = ["--trackers", "csrt,kcf", "--stabilize", "off,paper", "--sequences"]
    assert main(["vot-workspace", str(folder), *arguments, str(sequences)]) == 0
    config = configparser.ConfigParser()
    config.read(folder / "trackers.ini")
    labels = ["csrt-off", "csrt-paper", "kcf-off", "kcf-paper"]
    assert config.sections() == labels
    told = capsys.readouterr().out
    assert "trackers: 4, sequences: 1\n" in told
    assert f"cd '{folder}'" in told
    assert f"vot evaluate {' '.join(labels)}\n" in told
    assert f"vot analysis --name all {' '.join(labels)}\n" in told


def test_weights_belong_to_a_tracker(sequences, shared, tmp_path):
    weights = shared("data/weights/nanotrackv3")
    arguments = ["--trackers", "nanotrack_v3", "--stabilize", "off", "--sequences", str(sequences)]
    arguments += ["--weights", f"nanotrack_v3={weights}"]
    assert main(["vot-workspace", str(tmp_path / "ws"), *arguments]) == 0
    assert f"--weights {weights}" in (tmp_path / "ws" / "trackers.ini").read_text()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("--trackers", "csrt,magic"), "'magic'", id="unknown tracker"),
        pytest.param(("--stabilize", "off,on"), "'on'", id="unknown steadying"),
        pytest.param(("--weights", "gone"), "its path", id="weights of no tracker"),
        pytest.param(("--weights", "kcf=gone"), "kcf is not in --trackers", id="another tracker"),
        pytest.param(("--weights", "csrt=gone"), "csrt has no weights", id="weights in vain"),
        pytest.param(("--trackers", "nanotrack_v1"), "needs weights", id="weights not given"),
        pytest.param(("--stack", "No Such"), "No Such", id="no stack"),
        pytest.param(("--sequences", "gone"), "gone", id="no sequences"),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_trace(sequences, tmp_path, arguments, named, capsys):
    given = ["--sequences", str(sequences)] if "--sequences" not in arguments else []
    assert main(["vot-workspace", str(tmp_path / "ws"), *given, *arguments]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("ssiam: ")
    assert named in told.err
    assert told.err.count("\n") == 1
    assert not (tmp_path / "ws").exists()


def test_a_second_run_needs_force(sequences, tmp_path, capsys):
    command = ["vot-workspace", str(tmp_path / "ws"), "--sequences", str(sequences)]
    assert [main(command), main(command), main([*command, "--force"])] == [0, 2, 0]
    assert "config.yaml exists already: give --force" in capsys.readouterr().err
