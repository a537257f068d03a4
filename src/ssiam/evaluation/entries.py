"""What a benchmark compares: trackers, each with a way of steadying."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ssiam.errors import check_choice
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers import TRACKERS, SteadiedTracker, TrackerName, load_tracker


@dataclass(frozen=True)
class Entry:
    """One competitor.

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
        """Name of its results: tracker, method, and every number that is not the default one."""
        changed = [f"{name}={value}" for name, value in self.config.changed_options().items()]
        return "-".join([self.tracker, self.config.stabilize, *changed])

    def load(self, threads: int) -> SteadiedTracker:
        """The tracker, ready to be started."""
        return load_tracker(
            self.tracker, weights=self.weights, stabilize=self.config, threads=threads
        )


def entries(
    trackers: Sequence[str], methods: Sequence[Method], weights: Mapping[str, Path]
) -> list[Entry]:
    """Every tracker with every method; `weights` by the tracker's name."""
    return [
        Entry(check_choice("tracker", name, TRACKERS), StabilizerConfig(method), weights.get(name))
        for name in trackers
        for method in methods
    ]
