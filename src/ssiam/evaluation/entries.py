"""What a benchmark compares: trackers, each with a way of steadying."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from ssiam.errors import check_choice
from ssiam.stabilize import Method, StabilizerConfig
from ssiam.trackers import TRACKERS, StabilizedTracker, TrackerName, load_tracker


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
        own = StabilizerConfig(self.config.stabilize)
        changed = [
            f"{field.name}={getattr(self.config, field.name)}"
            for field in fields(self.config)
            if getattr(self.config, field.name) != getattr(own, field.name)
        ]
        return "-".join([self.tracker, self.config.stabilize, *changed])

    def load(self, threads: int) -> StabilizedTracker:
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
