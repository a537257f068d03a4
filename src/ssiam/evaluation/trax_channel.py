"""Standard output for the TraX protocol alone: whatever else prints goes to standard error."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

_STDOUT, _STDERR = 1, 2
# Tells libtrax the descriptor to write to, in place of standard output.
_OUT_VARIABLE = "TRAX_OUT"


@contextmanager
def protocol_alone() -> Iterator[None]:
    """Leave standard output to the protocol, in Python and in C, until the process ends.

    What else is printed there goes to standard error. The official toolkit reads both through
    one pipe, in which half a line of chatter hides the message after it: where the two are one,
    chatter is dropped, and standard error is itself again afterwards, for the last words.
    """
    sys.stdout.flush()
    os.environ[_OUT_VARIABLE] = str(os.dup(_STDOUT))
    stderr = os.dup(_STDERR)
    if os.path.sameopenfile(_STDOUT, _STDERR):
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, _STDERR)
        os.close(silence)
    os.dup2(_STDERR, _STDOUT)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(stderr, _STDERR)
        os.close(stderr)
