"""`ssiam trax`: what is wrong with its arguments is told before the protocol begins."""

import importlib.util
import subprocess
import sys

import pytest

from ssiam.cli import main

pytest.importorskip("trax")


def test_without_vot_trax_one_line_tells_what_to_install(monkeypatch, capsys):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "trax" else real(name)
    )
    for command in (["trax"], ["vot-workspace", "ws"]):
        assert main(command) == 2
        told = capsys.readouterr()
        assert told.out == ""
        assert "pip install 'ssiam[vot]'" in told.err
        assert told.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("--tracker", "magic"), "nanotrack_v3", id="unknown tracker"),
        pytest.param(("--stabilize", "magic"), "paper", id="unknown steadying"),
        pytest.param(("--windw", "9"), "--windw", id="unknown option"),
        pytest.param(("clip.mp4",), "clip.mp4", id="a clip"),
    ],
)
def test_bad_arguments_are_one_line(arguments, named, capsys):
    assert main(["trax", *arguments]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert named in told.err
    assert told.err.count("\n") == 1


def test_weights_that_are_missing_are_one_line_and_no_protocol():
    command = [sys.executable, "-m", "ssiam", "trax", "--tracker", "nanotrack_v2"]
    done = subprocess.run(
        [*command, "--weights", "gone"], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "gone" in done.stderr


def test_help_is_documentation(capsys):
    main(["trax", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    for word in ("--tracker", "--stabilize", "--thx1", "vot-workspace", "[default"):
        assert word in told
