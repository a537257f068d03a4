"""`ssiam --help`: every command with a line about it."""

from __future__ import annotations

import pytest

from ssiam.cli import main
from ssiam.cli.main import app


def _words(text):
    """The words inside of the help's frames."""
    return " ".join(text.replace("│", " ").split())


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]], ids=["nothing", "--help", "-h"])
def test_the_overview_says_what_each_command_does(capsys, arguments):
    assert main(arguments) == 0
    told = _words(capsys.readouterr().out)
    commands = {name: app[name] for name in app if not name.startswith("-")}
    assert {"track", "live", "vot-workspace"} <= set(commands)
    for name, command in commands.items():
        about = command.help or command.default_command.__doc__
        summary = about.split("\n\n")[0]
        assert f"{name} {_words(summary)}" in told


def test_an_unknown_command_is_named(capsys):
    assert main(["follow"]) == 2
    assert '"follow"' in capsys.readouterr().err
