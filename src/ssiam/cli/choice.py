"""`TrackerChoice`: the options of every command that tracks."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
from cyclopts import Group, Parameter

from ssiam.outputs import NamedPath
from ssiam.runtime import DeviceName, Precision, RuntimeName
from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import DEFAULT_TRACKER, StabilizedTracker, TrackerName, load_tracker

TARGET = Group("Target", sort_key=1)
RUNNING = Group("Running", sort_key=9)
STEADYING = Group("Steadying", sort_key=10)


@Parameter(name="*")
@dataclass(frozen=True)
class TrackerChoice:
    """Which tracker, and how its networks run.

    Parameters
    ----------
    tracker
        The tracker that runs on the steadied view.
    weights
        File or folder of the tracker's networks, for trackers that have any.
    runtime
        What runs the networks.
    threads
        CPU threads. From 2 on, a file's next camera motion is estimated while the tracker runs.
    precision
        Of the networks' arithmetic: bf16 is faster on CPUs that have it, int8 needs files that
        were exported so.
    device
        Where the networks run; the CPU unless given. onnxruntime has cuda, tensorrt and coreml,
        torch cuda and mps.
    """

    tracker: Annotated[TrackerName, Parameter(group=TARGET)] = DEFAULT_TRACKER
    weights: Annotated[Path | None, Parameter(group=TARGET)] = None
    runtime: Annotated[RuntimeName, Parameter(group=RUNNING)] = "openvino"
    threads: Annotated[int, Parameter(group=RUNNING)] = min(2, os.cpu_count() or 1)
    precision: Annotated[Precision, Parameter(group=RUNNING)] = "f32"
    device: Annotated[DeviceName | None, Parameter(group=RUNNING)] = None

    def weight_files(self) -> list[NamedPath]:
        """The files that are read as weights, for the check that no output is one of them."""
        if self.weights is None:
            return []
        return [("--weights", path) for path in (self.weights, *self.weights.glob("*"))]

    def load(self, config: StabilizerConfig) -> StabilizedTracker:
        """The tracker, steadied by `config`; errors as `load_tracker`."""
        cv2.setNumThreads(self.threads)
        return load_tracker(
            self.tracker,
            weights=self.weights,
            stabilize=config,
            runtime=self.runtime,
            threads=self.threads,
            precision=self.precision,
            device=self.device,
        )
