"""`ssiam trax`: a tracker as a TraX server, for the official VOT toolkit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
from cyclopts import Group, Parameter

from ssiam.evaluation.trax_channel import protocol_alone
from ssiam.evaluation.trax_server import check_trax, serve
from ssiam.runtime import DeviceName, Precision, RuntimeName
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import DEFAULT_TRACKER, TrackerName, load_tracker

_STEADY = StabilizerConfig()

_STEADYING = Group("Steadying", sort_key=1)


def trax(
    *,
    tracker: TrackerName = DEFAULT_TRACKER,
    weights: Path | None = None,
    runtime: RuntimeName = "openvino",
    threads: int = 1,
    precision: Precision = "f32",
    device: DeviceName | None = None,
    config: Annotated[StabilizerConfig, Parameter(name="*", group=_STEADYING)] = _STEADY,
) -> None:
    """Serve a tracker to a TraX client, such as the official VOT toolkit.

    It talks over standard input and output, and is started by the client, not by hand:
    `ssiam vot-workspace` writes what the toolkit needs for that.

    Parameters
    ----------
    tracker
        The tracker that runs on the steadied view.
    weights
        File or folder of the tracker's networks, for trackers that have any.
    runtime
        What runs the networks.
    threads
        CPU threads.
    precision
        Of the networks' arithmetic; int8 needs files that were exported so.
    device
        Where the networks run; the CPU unless given.
    """
    check_trax()
    cv2.setNumThreads(threads)
    with protocol_alone():
        serve(
            load_tracker(
                tracker,
                weights=weights,
                stabilize=config,
                runtime=runtime,
                threads=threads,
                precision=precision,
                device=device,
            )
        )
