"""Entries of a benchmark: a tracker with a stabilizer configuration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ssiam.errors import check_choice
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers import TRACKERS, StabilizedTracker, TrackerName, load_tracker


@dataclass(frozen=True)
class Entry:
    """A tracker with a stabilizer configuration, as a benchmark compares it.

    Attributes
    ----------
    tracker : str
    config : StabilizerConfig
    weights : Path, optional
    """

    tracker: TrackerName
    config: StabilizerConfig
    weights: Path | None = None

    @property
    def label(self) -> str:
        """Name of the results folder: tracker, method, and every non-default setting."""
        changed = [f"{name}={value}" for name, value in self.config.changed_options().items()]
        return "-".join([self.tracker, self.config.stabilize, *changed])

    def load(self, threads: int) -> StabilizedTracker:
        """Load the tracker, without a target."""
        return load_tracker(
            self.tracker, weights=self.weights, stabilize=self.config, threads=threads
        )


def entries(
    trackers: Sequence[str], methods: Sequence[Method], weights: Mapping[str, Path]
) -> list[Entry]:
    """Every tracker with every method; `weights` maps tracker names to files or folders.

    Raises
    ------
    ArgumentError
        Unknown tracker.
    """
    return [
        Entry(check_choice("tracker", name, TRACKERS), StabilizerConfig(method), weights.get(name))
        for name in trackers
        for method in methods
    ]
