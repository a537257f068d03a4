"""`ssiam`: reads the command line, and turns every error into one line and an exit code."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

from cyclopts import App, CycloptsError

from ssiam.errors import SsiamError, StreamError

DONE, USAGE_ERROR, BROKE_OFF = 0, 2, 3
INTERRUPTED = 128 + signal.SIGINT

app = App(
    name="ssiam",
    help="Keep hold of a chosen object in video from a shaking, moving camera.",
    help_format="markdown",
    help_epilogue="Exit codes: 0 done; 2 wrong usage or input; 3 the stream broke off "
    "(what was tracked is kept).",
    print_error=False,
    exit_on_error=False,
    suppress_keyboard_interrupt=False,
    result_action="return_value",
)
app.command("ssiam.cli.track:track", name="track")
app.command("ssiam.cli.live:live", name="live")
app.command("ssiam.cli.export:export", name="export")
app.command("ssiam.cli.bench:bench", name="bench")
app.command("ssiam.cli.eval:evaluate", name="eval")
app.command("ssiam.cli.tables:tables", name="tables")
app.command("ssiam.cli.tune:tune", name="tune")
app.command("ssiam.cli.train:train", name="train")
app.command("ssiam.cli.trax:trax", name="trax")
app.command("ssiam.cli.weights:weights", name="weights")
app.command("ssiam.cli.vot_workspace:vot_workspace", name="vot-workspace")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    signal.signal(signal.SIGTERM, _terminate)
    try:
        app(list(sys.argv[1:] if arguments is None else arguments))
    except CycloptsError as error:
        return _complain(f"{error} See ssiam --help.", USAGE_ERROR)
    except StreamError as error:
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
