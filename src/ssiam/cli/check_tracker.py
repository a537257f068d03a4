"""`ssiam check-tracker`: the checks of `ssiam.testing` on a tracker."""

from __future__ import annotations

from pathlib import Path

import cv2

from ssiam.errors import ContractError
from ssiam.runtime import RuntimeOptions
from ssiam.testing import CHECKS, run_checks
from ssiam.trackers import check_tracker_name, load_tracker


def check_tracker(tracker: str, /, *, weights: Path | None = None, threads: int = 1) -> None:
    """Check that a tracker does what ssiam expects of every tracker.

    The tracker runs on views of a generated clip. Each check is a line: ok, failed with the reason,
    or none if it does not apply. Exit code 1 if one failed.

    Parameters
    ----------
    tracker
        package.module:Class, whose code is run and whose folder must be in PYTHONPATH; or the name
        of a tracker, such as kcf.
    weights
        File or folder of the tracker's weights.
    threads
        CPU threads.
    """
    check_tracker_name(tracker)
    RuntimeOptions(threads=threads)  # raises, before so many threads start
    cv2.setNumThreads(threads)
    loaded = load_tracker(tracker, weights=weights, stabilize="off", threads=threads)
    failed = 0
    for outcome in run_checks(loaded.view_tracker.clone):
        failed += bool(outcome.problem)
        result = "failed" if outcome.problem else "ok" if outcome.applies else "none"
        reason = f": {outcome.problem}" if outcome.problem else ""
        print(f"{result:<7}{outcome.name}{reason}", flush=True)
    if failed:
        raise ContractError(f"{tracker} failed {failed} of {len(CHECKS)} checks")
