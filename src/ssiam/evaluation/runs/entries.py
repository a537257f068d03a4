"""Entries of a benchmark: a tracker with a stabilizer configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ssiam.errors import check_choice
from ssiam.runtime import RuntimeOptions
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers import (
    TRACKERS,
    StabilizedTracker,
    check_tracker_name,
    has_networks,
    is_named_class,
    load_tracker,
    recognizes_distractors,
)

DEFAULT_OPTIONS: Final = RuntimeOptions()
VARIANT_KEYS: Final = (
    "runtime",
    "device",
    "precision",
    "threads",
    "template_memory",
    "distractors",
    "weights",
)
"""Names in a label that belong to the run and not to the stabilizer's configuration."""


@dataclass(frozen=True)
class Entry:
    """A tracker with a stabilizer configuration, as a benchmark compares it.

    Attributes
    ----------
    tracker : str
        One of `TRACKERS`, or another name that `load_tracker` knows.
    config : StabilizerConfig
    weights : Path, optional
    options : RuntimeOptions
        How the networks run, and the CPU threads of the run.
    template_memory : bool
    distractors : bool, optional
        As for `load_tracker`.
    """

    tracker: str
    config: StabilizerConfig
    weights: Path | None = None
    options: RuntimeOptions = DEFAULT_OPTIONS
    template_memory: bool = False
    distractors: bool | None = None

    @property
    def label(self) -> str:
        """Name of the results folder: tracker, method, and every non-default setting."""
        changed = {**self.config.changed_options(), **changed_runtime(self.options)}
        if self.template_memory:
            changed["template_memory"] = True
        if self.distractors not in (None, recognizes_distractors(self.tracker)):
            changed["distractors"] = self.distractors
        settings = [f"{name}={value}" for name, value in changed.items()]
        return "-".join([self.tracker.replace(":", "."), self.config.stabilize, *settings])

    def load(self) -> StabilizedTracker:
        """Load the tracker, without a target."""
        return load_tracker(
            self.tracker,
            weights=self.weights,
            stabilize=self.config,
            runtime=self.options.runtime,
            threads=self.options.threads,
            precision=self.options.precision,
            device=self.options.device,
            template_memory=self.template_memory,
            distractors=self.distractors,
        )


def changed_runtime(options: RuntimeOptions) -> dict[str, str | int]:
    """The runtime options that differ from the defaults, by name."""
    values = {
        "runtime": options.runtime,
        "device": options.resolved_device,
        "precision": options.precision,
        "threads": options.threads,
    }
    defaults = ("openvino", "cpu", "f32", 1)
    return {
        name: value
        for (name, value), default in zip(values.items(), defaults, strict=True)
        if value != default
    }


def options_for(tracker: str, options: RuntimeOptions) -> RuntimeOptions:
    """The options that apply to a tracker: only the threads, if it has no networks."""
    return options if has_networks(tracker) else RuntimeOptions(threads=options.threads)


def entries(
    trackers: Sequence[str],
    methods: Sequence[Method],
    weights: Mapping[str, Path],
    options: RuntimeOptions = DEFAULT_OPTIONS,
    *,
    template_memory: bool = False,
    distractors: bool | None = None,
    named_classes: bool = False,
) -> list[Entry]:
    """Every tracker with every method; `weights` maps tracker names to files or folders.

    Of `options`, only the threads apply to trackers without networks and to classes of other
    packages; `distractors` does not apply to them, nor `template_memory` to the former. With
    `named_classes` the names may be those of such classes, whose code the entries run.

    Raises
    ------
    ArgumentError
        Unknown tracker.
    """
    for name in trackers:
        if named_classes:
            check_tracker_name(name)
        else:
            check_choice("tracker", name, TRACKERS)
    return [
        Entry(
            name,
            StabilizerConfig(method),
            weights.get(name),
            options_for(name, options),
            template_memory and (has_networks(name) or is_named_class(name)),
            distractors if has_networks(name) else None,
        )
        for name in trackers
        for method in methods
    ]
