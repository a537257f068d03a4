"""Why runs of a benchmark have no result: a line in a file beside those of the others."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from ssiam.errors import SinkError
from ssiam.evaluation.layouts import Experiment, file_name
from ssiam.evaluation.lines import write_lines


def failure_path(results: Path, sequence: str, experiment: Experiment) -> Path:
    """``RESULTS/failed/<experiment>/<sequence>.log``."""
    return results / "failed" / experiment / f"{file_name(sequence)}.log"


def write_failure(path: Path, reason: str) -> None:
    """Record why a run has no result; on a full disk it is only told."""
    with suppress(SinkError):
        write_lines(path, [reason.encode("ascii", "backslashreplace").decode()])


def clear_failure(path: Path) -> None:
    """The run has a result now."""
    with suppress(OSError):
        path.unlink(missing_ok=True)
