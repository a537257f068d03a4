"""The command line: one module per command."""

from ssiam.cli.main import main

__all__ = ["main"]
