"""`ssiam trax`: a tracker as a TraX server, for the official VOT toolkit."""

from __future__ import annotations

from ssiam.cli.options import (
    DEFAULT_STABILIZATION,
    DEFAULT_TRACKER_OPTIONS,
    StabilizationOptions,
    TrackerOptions,
)
from ssiam.evaluation.vot.trax import check_trax, reserve_stdout, serve


def trax(
    *,
    tracker_options: TrackerOptions = DEFAULT_TRACKER_OPTIONS,
    config: StabilizationOptions = DEFAULT_STABILIZATION,
) -> None:
    """Serve a tracker to a TraX client, such as the official VOT toolkit.

    The client starts this command and communicates over standard input and output; it is not
    meant to be started by hand. `ssiam vot-workspace` writes the configuration for the toolkit.
    """
    check_trax()
    with reserve_stdout():
        serve(tracker_options.load(config))
