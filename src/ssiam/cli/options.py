"""Options shared by several commands: groups, trackers, stabilization, and parsed values."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, TypeAlias

import cv2
from cyclopts import Group, Parameter

from ssiam.datasets import SHAKE_KINDS, Shake, ShakeBorder
from ssiam.errors import ArgumentError, check_choice
from ssiam.motion import MaskOf
from ssiam.outputs import NamedPath, check_distinct
from ssiam.runtime import DeviceName, Precision, RuntimeName, RuntimeOptions
from ssiam.stabilize import PaperConfig, PredictConfig, StabilizerConfig
from ssiam.trackers import (
    DEFAULT_TRACKER,
    TRACKERS,
    StabilizedTracker,
    TrackerName,
    check_tracker_name,
    load_tracker,
)

TARGET_GROUP = Group("Target", sort_key=1)
RUNTIME_GROUP = Group("Runtime", sort_key=9)
STABILIZATION_GROUP = Group("Stabilization", sort_key=10)

StabilizationOptions: TypeAlias = Annotated[
    StabilizerConfig, Parameter(name="*", group=STABILIZATION_GROUP)
]
"""One option per field of the configuration, in the commands that track one video."""

DEFAULT_STABILIZATION = StabilizerConfig()

# Flags of the parts of `StabilizerConfig` have no prefix: --thx1, --no-choose.
Parameter(name="*", group=Group("Stabilization: paper and literal", sort_key=11))(PaperConfig)
Parameter(name="*", group=Group("Stabilization: predict", sort_key=12))(PredictConfig)


def _check_tracker(type_: object, name: str) -> None:
    """Raise `ArgumentError` unless the word of ``--tracker`` names a tracker."""
    check_tracker_name(name)


@Parameter(name="*")
@dataclass(frozen=True)
class TrackerOptions:
    """The tracker, and how its networks run.

    Parameters
    ----------
    tracker
        The tracker that runs on the stabilized view. lite, csrt, kcf and mil need no weights.
        package.module:Class is a class of your own or of another package, whose code is run; its
        folder must be in PYTHONPATH. Installed packages may add names.
    weights
        File or folder of the tracker's weights. By default those of ssiam weights import, or
        those in ./weights.
    runtime
        Library that runs the networks.
    threads
        CPU threads. With 2 or more, the camera motion of a file's next frame is estimated while
        the tracker runs.
    precision
        Precision of the networks' arithmetic: bf16 is faster on CPUs that support it, int8 needs
        weights of ssiam weights export --precision int8.
    device
        Device that runs the networks, by default the CPU. onnxruntime supports cuda, tensorrt and
        coreml, torch supports cuda and mps.
    template_memory
        Take further templates of the target while it is tracked, after THOR.
    distractors
        Recognize objects like the target by their positions. By default only lite does.
    """

    tracker: Annotated[
        TrackerName | str, Parameter(group=TARGET_GROUP, validator=_check_tracker)
    ] = DEFAULT_TRACKER
    weights: Annotated[Path | None, Parameter(group=TARGET_GROUP)] = None
    runtime: Annotated[RuntimeName, Parameter(group=RUNTIME_GROUP)] = "openvino"
    threads: Annotated[int, Parameter(group=RUNTIME_GROUP)] = min(2, os.cpu_count() or 1)
    precision: Annotated[Precision, Parameter(group=RUNTIME_GROUP)] = "f32"
    device: Annotated[DeviceName | None, Parameter(group=RUNTIME_GROUP)] = None
    template_memory: Annotated[bool, Parameter(group=TARGET_GROUP)] = False
    distractors: Annotated[bool | None, Parameter(group=TARGET_GROUP)] = None

    def weight_files(self) -> list[NamedPath]:
        """The files that are read as weights, to check that no output is one of them."""
        if self.weights is None:
            return []
        return [("--weights", path) for path in (self.weights, *self.weights.glob("*"))]

    def load(
        self, config: StabilizerConfig, static_mask: MaskOf | None = None
    ) -> StabilizedTracker:
        """The tracker, stabilized according to `config`; raises as `load_tracker`."""
        RuntimeOptions(threads=self.threads)  # raises, before so many threads start
        cv2.setNumThreads(self.threads)
        return load_tracker(
            self.tracker,
            weights=self.weights,
            stabilize=config,
            runtime=self.runtime,
            threads=self.threads,
            precision=self.precision,
            device=self.device,
            template_memory=self.template_memory,
            distractors=self.distractors,
            static_mask=static_mask,
        )


DEFAULT_TRACKER_OPTIONS = TrackerOptions()


@cache
def report_uncalibrated(name: str) -> None:
    """Say on standard error, once in a process, that a tracker's score is not a probability."""
    print(
        f"ssiam: the score of {name} is its own, not a calibrated probability; lost targets may "
        "be reported early or late",
        file=sys.stderr,
    )


def split_words(text: str) -> list[str]:
    """The words of a comma-separated list, without empty ones."""
    return [word.strip() for word in text.split(",") if word.strip()]


def parse_levels(text: str | None) -> tuple[float, float] | None:
    """The values of ``--levels LOW,HIGH``; `ArgumentError` unless they are two numbers."""
    if text is None:
        return None
    try:
        low, high = (float(number) for number in text.split(","))
    except ValueError:
        raise ArgumentError(
            f"--levels {text!r}: give the values shown as black and white, such as 7000,8500"
        ) from None
    return low, high


def parse_weights(pairs: Iterable[str], *, named_classes: bool = False) -> dict[str, Path]:
    """Paths by tracker name, from ``NAME=PATH``; `ArgumentError` for another form or name.

    With `named_classes` a name may be that of another package's class.
    """
    paths: dict[str, Path] = {}
    for pair in pairs:
        name, _, path = pair.partition("=")
        if not (name and path):
            raise ArgumentError(
                f"--weights {pair!r}: give the tracker and its path, such as "
                "nanotrack_v3=weights/nanotrackv3"
            )
        known = check_tracker_name(name) if named_classes else ""
        paths[known or check_choice("tracker", name, TRACKERS)] = Path(path)
    return paths


def parse_shakes(
    strengths: str, kinds: str, seeds: int, exposure: float, readout: float, border: ShakeBorder
) -> list[Shake | None]:
    """Every combination of strength, kind and seed, each once; None for a strength of 0.

    Raises
    ------
    ArgumentError
        A strength is not a number, a list is empty, a value is out of range, or kinds of shake
        are given without a strength.
    """
    if seeds < 1:
        raise ArgumentError(f"--shake-seeds {seeds}: must be at least 1")
    chosen = [check_choice("kind of shake", word, SHAKE_KINDS) for word in split_words(kinds)]
    found = [
        Shake(strength, kind, seed, exposure, readout, border)
        for strength in _strengths(strengths)
        for kind in chosen
        for seed in range(seeds)
    ]
    if not found:
        raise ArgumentError(f"--shake {strengths!r} --shake-kind {kinds!r}: give at least one")
    if found[0] != Shake(0.0) and not any(shake.strength for shake in found):
        raise ArgumentError(
            "--shake-kind and the other --shake-... options need a strength: give --shake too, "
            "such as --shake 0,0.03"
        )
    return list(dict.fromkeys(shake if shake.strength else None for shake in found))


def _strengths(text: str) -> list[float]:
    try:
        return [float(word) for word in split_words(text)]
    except ValueError:
        raise ArgumentError(
            f"--shake {text!r}: give shares of the width between commas, such as 0,0.01,0.03"
        ) from None


def check_results_folder(out: Path, datasets: Iterable[Path], weights: Iterable[Path] = ()) -> None:
    """Raise `ArgumentError` if --out is the folder of a dataset or of weights."""
    inputs = [("the dataset", path) for path in datasets]
    check_distinct([("--out", out)], [*inputs, *(("the weights", path) for path in weights)])


def report_leftover_parts(parts: Iterable[Path]) -> None:
    """List the partial outputs of unfinished runs on standard error."""
    for part in parts:
        print(
            f"ssiam: {part} is from a run that was killed or is still running; it is kept",
            file=sys.stderr,
        )
