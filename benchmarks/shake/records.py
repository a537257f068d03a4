"""One run of benchmarks/shake/run.py, as it is kept."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

NO_SHAKE = "none"

Key: TypeAlias = tuple[str, str, str, float, int, str]


@dataclass(frozen=True)
class Run:
    """A tracker with a setting on a shaken sequence.

    Attributes
    ----------
    tracker, setting : str
    kind : str
        Of shake, or "none".
    strength : float
        Share of the width.
    seed : int
    sequence : str
    frames : int
        Of the sequence.
    lost : int
        How often the target was lost in the supervised run.
    tracked : int
        Frames of that run with a box: neither starts nor failures nor skipped ones.
    overlap, settled_overlap : float
        Sum over those whose truth is told, and without the first ten from each start on.
    counted, settled : int
        How many frames these are.
    told_lost, one_pass_told_lost : int
        Frames in which the tracker says that the target is lost.
    success : float
        Area under the success curve of the one-pass run; nan without one.
    seconds : float
        What all of it took.
    """

    tracker: str
    setting: str
    kind: str
    strength: float
    seed: int
    sequence: str
    frames: int = 0
    lost: int = 0
    tracked: int = 0
    overlap: float = 0.0
    counted: int = 0
    settled_overlap: float = 0.0
    settled: int = 0
    told_lost: int = 0
    one_pass_told_lost: int = 0
    success: float | None = None
    seconds: float = 0.0

    @property
    def shaken(self) -> tuple[str, float, int, str]:
        """What it ran on."""
        return self.kind, self.strength, self.seed, self.sequence

    @property
    def key(self) -> Key:
        """Which run it is."""
        return self.tracker, self.setting, *self.shaken

    @property
    def has_one_pass(self) -> bool:
        """Whether there was a one-pass run."""
        return self.success is not None

    def path(self, out: Path) -> Path:
        """Its file."""
        shake = f"{self.kind}-{self.strength:g}-seed{self.seed}"
        setting = self.setting.replace(",", "").replace(" ", "-")
        return out / self.tracker / setting / shake / f"{self.sequence}.json"


Runs: TypeAlias = Sequence[Run]


def read_runs(out: Path) -> list[Run]:
    """All runs that lie in a folder."""
    paths = sorted(out.glob("*/*/*-seed*/*.json"))
    return [Run(**json.loads(path.read_text())) for path in paths]
