"""`ShakeRun`: the stored result of one run of benchmarks/shake/run.py."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, TypeAlias

NO_SHAKE = "none"

# Attribute -> key in the JSON files.
_JSON_KEYS: Final = {
    "reported_lost": "told_lost",
    "one_pass_reported_lost": "one_pass_told_lost",
}

Key: TypeAlias = tuple[str, str, str, float, int, str]


@dataclass(frozen=True)
class ShakeRun:
    """Result of a tracker with a setting on a shaken sequence.

    Attributes
    ----------
    tracker, setting : str
    kind : str
        Kind of shake, or "none".
    strength : float
        Standard deviation of the shifts, share of the width.
    seed : int
    sequence : str
    frames : int
        Frames of the sequence.
    lost : int
        Number of lost targets in the supervised run.
    tracked : int
        Tracked frames of the supervised run: neither starts nor failures nor skipped ones.
    overlap, settled_overlap : float
        Sum of the overlap over the tracked frames with ground truth, and without burn-in: the first
        ten frames after each start.
    counted, settled : int
        Numbers of these frames.
    reported_lost, one_pass_reported_lost : int
        Frames in which the tracker reports the target as lost.
    success : float, optional
        Area under the success curve of the one-pass run.
    seconds : float
        Time of both runs.
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
    reported_lost: int = 0
    one_pass_reported_lost: int = 0
    success: float | None = None
    seconds: float = 0.0

    @property
    def shaken(self) -> tuple[str, float, int, str]:
        """Shake and sequence: kind, strength, seed, name."""
        return self.kind, self.strength, self.seed, self.sequence

    @property
    def key(self) -> Key:
        """Identity of the run."""
        return self.tracker, self.setting, *self.shaken

    @property
    def has_one_pass(self) -> bool:
        """Whether it has a one-pass run."""
        return self.success is not None

    def path(self, out: Path) -> Path:
        """File of the run in the folder `out`."""
        shake = f"{self.kind}-{self.strength:g}-seed{self.seed}"
        setting = self.setting.replace(",", "").replace(" ", "-")
        return out / self.tracker / setting / shake / f"{self.sequence}.json"

    def to_json(self) -> str:
        """The run as a line of JSON."""
        return json.dumps(
            {_JSON_KEYS.get(name, name): value for name, value in asdict(self).items()}
        )

    @classmethod
    def from_json(cls, text: str) -> ShakeRun:
        """A run that was written by `to_json`."""
        names = {key: name for name, key in _JSON_KEYS.items()}
        return cls(**{names.get(key, key): value for key, value in json.loads(text).items()})


Runs: TypeAlias = Sequence[ShakeRun]


def read_runs(out: Path) -> list[ShakeRun]:
    """All runs in a folder."""
    paths = sorted(out.glob("*/*/*-seed*/*.json"))
    return [ShakeRun.from_json(path.read_text()) for path in paths]
