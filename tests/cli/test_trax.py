"""`ssiam trax`: wrong arguments are reported before the protocol starts."""

import importlib.util
import subprocess
import sys

import pytest

from ssiam.cli import main

pytest.importorskip("trax")


def test_missing_vot_trax_names_the_extra(monkeypatch, capsys):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "trax" else real(name)
    )
    for command in (["trax"], ["vot-workspace", "ws"]):
        assert main(command) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert "pip install 'ssiam[vot]'" in captured.err
        assert captured.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("--tracker", "magic"), "nanotrack_v3", id="unknown tracker"),
        pytest.param(("--stabilize", "magic"), "paper", id="unknown stabilization"),
        pytest.param(("--windw", "9"), "--windw", id="unknown option"),
        pytest.param(("clip.mp4",), "clip.mp4", id="a clip"),
    ],
)
def test_wrong_arguments_give_one_line_error(arguments, named, capsys):
    assert main(["trax", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert named in captured.err
    assert captured.err.count("\n") == 1


def test_missing_weights_give_one_line_error():
    command = [sys.executable, "-m", "ssiam", "trax", "--tracker", "nanotrack_v2"]
    done = subprocess.run(
        [*command, "--weights", "missing"], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "missing" in done.stderr


def test_help_describes_the_options(capsys):
    main(["trax", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    for word in ("--tracker", "--stabilize", "--thx1", "vot-workspace", "[default"):
        assert word in text
