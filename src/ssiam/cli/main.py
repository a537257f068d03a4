"""`ssiam`: reads the command line, and turns every error into one line and an exit code."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

from cyclopts import App, CycloptsError, Group

from ssiam.errors import IncompleteError, SsiamError, StreamError

DONE, USAGE_ERROR, BROKE_OFF = 0, 2, 3
INTERRUPTED = 128 + signal.SIGINT

app = App(
    name="ssiam",
    help="Keep hold of a chosen object in video from a shaking, moving camera.",
    help_format="markdown",
    help_epilogue="Exit codes: 0 done; 2 wrong usage or input; 3 the stream broke off, frames of "
    "it cannot be decoded, or something else is missing (what was done is kept).",
    print_error=False,
    exit_on_error=False,
    suppress_keyboard_interrupt=False,
    result_action="return_value",
)
_COMMANDS = {
    "Follow targets": ("track:track", "live:live", "export:export"),
    "Measure trackers": (
        "bench:bench",
        "eval:evaluate",
        "tables:tables",
        "tune:tune",
        "trax:trax",
        "vot_workspace:vot_workspace",
    ),
    "Networks": ("train:train", "weights:weights"),
}
_OPTIONS = Group("Options", sort_key=len(_COMMANDS))
app["--help"].group = app["--version"].group = _OPTIONS
for place, (title, functions) in enumerate(_COMMANDS.items()):
    group = Group(title, sort_key=place)
    for order, function in enumerate(functions):
        name = function.partition(":")[0].replace("_", "-")
        app.command(f"ssiam.cli.{function}", name=name, group=group, sort_key=order)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    signal.signal(signal.SIGTERM, _terminate)
    # Of a terminal that is closed; nohup has it ignored, and that stays so.
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        signal.signal(signal.SIGHUP, _terminate)
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0].startswith("-"):
        app.resolved_commands()  # the overview shows a line of each command's own help
    try:
        app(words)
    except CycloptsError as error:
        return _complain(f"{error} See ssiam --help.", USAGE_ERROR)
    except (StreamError, IncompleteError) as error:
        return _complain(str(error), BROKE_OFF)
    except SsiamError as error:
        return _complain(str(error), USAGE_ERROR)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # whoever read the output has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    return DONE


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    """Leave by the front door, so that outputs are closed."""
    raise SystemExit(128 + number)


def _complain(message: str, code: int) -> int:
    print(f"ssiam: {' '.join(message.split())}", file=sys.stderr)
    return code
