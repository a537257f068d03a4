"""`ssiam --help`: lists every command with its summary."""

from __future__ import annotations

import errno
import sys

import pytest

import ssiam
from ssiam.cli import main
from ssiam.cli.main import app


def _words(text):
    """The words of the help text without its frames."""
    return " ".join(text.replace("│", " ").split())


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]], ids=["nothing", "--help", "-h"])
def test_overview_contains_each_summary(capsys, arguments):
    assert main(arguments) == 0
    output = _words(capsys.readouterr().out)
    commands = {name: app[name] for name in app if not name.startswith("-")}
    assert {"track", "live", "vot-workspace"} <= set(commands)
    for name, command in commands.items():
        text = command.help or command.default_command.__doc__
        summary = text.split("\n\n")[0]
        assert f"{name} {_words(summary)}" in output


def test_unknown_command_is_named(capsys):
    assert main(["follow"]) == 2
    assert '"follow"' in capsys.readouterr().err


@pytest.mark.parametrize("flag", ["-v", "--verbose"])
def test_the_version_with_what_the_camera_motion_runs_on(flag, capsys, monkeypatch):
    monkeypatch.setenv("SSIAM_KERNEL", "numpy")
    assert main(["--version", flag]) == 0
    version, motion = capsys.readouterr().out.splitlines()
    assert version == ssiam.__version__
    assert motion.startswith("camera motion: NumPy (")


def test_an_error_of_the_network_is_not_blamed_on_the_output(monkeypatch):
    class Unreachable:
        help_flags = ()

        def __call__(self, words):
            raise ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused")

    monkeypatch.setattr(sys.modules["ssiam.cli.main"], "app", Unreachable())
    with pytest.raises(ConnectionRefusedError):
        main(["weights", "list"])
