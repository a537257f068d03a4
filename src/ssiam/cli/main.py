"""`ssiam`: runs a command; every error becomes one line and an exit code."""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

from cyclopts import App, CycloptsError, Group

from ssiam import __version__
from ssiam.addresses import redact_words
from ssiam.cli.box_words import join_box_words
from ssiam.errors import ContractError, IncompleteError, SsiamError, StreamError

SUCCESS, CHECK_FAILED, USAGE_ERROR, INCOMPLETE = 0, 1, 2, 3
INTERRUPTED = 128 + signal.SIGINT

# Of writing to an open stream: a full disk or quota, a file that is too large, a closed descriptor.
_OUTPUT_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EBADF, errno.EIO)

app = App(
    name="ssiam",
    version=__version__,
    help="Track a chosen object in video from a shaking, moving camera.",
    help_format="markdown",
    help_epilogue="Exit codes: 0 success; 1 a check of check-tracker failed; 2 wrong usage or "
    "input; 3 incomplete: the stream broke off, frames could not be decoded, or a part of the work "
    "failed (finished work is kept).",
    print_error=False,
    exit_on_error=False,
    suppress_keyboard_interrupt=False,
    result_action="return_value",
)
_COMMANDS = {
    "Track targets": ("track:track", "live:live", "export:export"),
    "Evaluate trackers": (
        "bench:bench",
        "eval:evaluate",
        "tables:tables",
        "tune:tune",
        "trax:trax",
        "vot_workspace:vot_workspace",
        "check_tracker:check_tracker",
    ),
    "Networks": ("train:train", "weights:weights"),
}
_OPTIONS = Group("Options", sort_key=len(_COMMANDS))
app["--help"].group = app["--version"].group = _OPTIONS
for position, (title, functions) in enumerate(_COMMANDS.items()):
    group = Group(title, sort_key=position)
    for order, function in enumerate(functions):
        name = function.partition(":")[0].replace("_", "-")
        app.command(f"ssiam.cli.{function}", name=name, group=group, sort_key=order)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    signal.signal(signal.SIGTERM, _terminate)
    # Sent when the terminal is closed; nohup ignores it, which is kept.
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
        signal.signal(signal.SIGHUP, _terminate)
    words = join_box_words(sys.argv[1:] if arguments is None else arguments)
    try:
        _run(words)
    except CycloptsError as error:
        return _fail(f"{error} See ssiam --help.", USAGE_ERROR, words)
    except (StreamError, IncompleteError) as error:
        return _fail(str(error), INCOMPLETE, words)
    except ContractError as error:
        return _fail(str(error), CHECK_FAILED, words)
    except SsiamError as error:
        return _fail(str(error), USAGE_ERROR, words)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output has closed it
        _discard_output()
        return SUCCESS
    except OSError as error:
        if error.filename is not None or error.errno not in _OUTPUT_ERRORS:
            raise
        _discard_output()
        reason = error.strerror or type(error).__name__
        return _fail(f"standard output: cannot be written ({reason})", USAGE_ERROR, words)
    return SUCCESS


def _run(words: list[str]) -> None:
    """Run a command, and write out what it prints."""
    if sys.stdout is not None and hasattr(sys.stdout, "reconfigure"):
        # Names of files may have bytes that are no characters, or not those of the terminal.
        sys.stdout.reconfigure(errors="backslashreplace")
    if words == ["--version"]:  # cyclopts prints it too, but imports rich for it
        print(__version__)
    elif sorted(words) in (["--version", "-v"], ["--verbose", "--version"]):
        from ssiam.motion import kernel

        print(f"{__version__}\ncamera motion: {kernel.description()}")
    else:
        if not words or words[0] in app.help_flags:
            app.resolved_commands()  # the overview shows the first line of each command's help
        app(words)
    if sys.stdout is not None:
        sys.stdout.flush()


def _discard_output() -> None:
    """Discard what standard output still holds, so that closing it does not fail."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    """Exit through `SystemExit`, so that outputs are closed."""
    raise SystemExit(128 + number)


def _fail(message: str, code: int, words: list[str]) -> int:
    line = " ".join(redact_words(message, words).split())
    # Names of files and servers' words may have control characters of the terminal.
    shown = "".join(each if each.isprintable() else repr(each)[1:-1] for each in line)
    print(f"ssiam: {shown}", file=sys.stderr)
    return code
