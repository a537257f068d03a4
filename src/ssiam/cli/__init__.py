"""The command line: one file a command."""

from ssiam.cli.main import main

__all__ = ["main"]
