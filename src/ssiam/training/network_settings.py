"""`NetworkSettings`: which network is trained, from where, and which of its parts learn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from ssiam.errors import ArgumentError
from ssiam.networks.lite import BLOCKS
from ssiam.networks.lite2 import ATTENTION_BLOCKS
from ssiam.trackers.lite import SHIPPED
from ssiam.training.validation_settings import require

__all__ = ["WEIGHTS", "NetworkSettings"]

LEVELS: Final = 3  # of the backbone
WEIGHTS: Final = "weights.pth"  # in a run's folder


@dataclass(frozen=True)
class NetworkSettings:
    """What is trained.

    Attributes
    ----------
    kind : {"lite", "lite2", "mask"}
        The network of `ssiam.networks.lite`, `ssiam.networks.lite2` or `ssiam.networks.box_mask`.
        Of the numbers below, "lite2" uses `attention`, `begin` and `frozen_steps` alone, "mask"
        `weights` and `begin`.
    attention : int
        Attention blocks of "lite2"; 0: correlation alone.
    blocks : int
        Of the backbone, 9 to 11.
    light : bool
        Whether a light stem takes the place of the backbone's first two levels.
    weights : str, optional
        File of the backbone's ImageNet weights; None: that of the installed package.
    begin : str, optional
        The weights.pth of a run to begin with, which may have had no light stem; or "lite", the
        shipped ones. None: ImageNet's weights and a network that knows nothing else. "lite2"
        begins with the authors' nanotrackv3.pth, or with the weights.pth of a run.
    learns : {"all", "mask"}
        Everything, or the mask head alone: the rest, and so the tracking, stays as it is. The
        numbers below then say nothing.
    stem_steps : int
        Steps in which only the light stem learns, from the blocks that it stands for.
    frozen_steps : int
        Steps, with those, until the backbone learns.
    trained_levels : int
        Levels of the backbone that learn from then on, from the deepest: 0, 1 (stride 16) or 2
        (strides 16 and 8); with a light stem 0, 1 or 3 (all). What is before them does not learn
        and runs in OpenVINO.
    """

    kind: Literal["lite", "lite2", "mask"] = "lite"
    attention: int = ATTENTION_BLOCKS
    blocks: int = BLOCKS
    light: bool = True
    weights: str | None = None
    begin: str | None = None
    learns: Literal["all", "mask"] = "all"
    stem_steps: int = 1000
    frozen_steps: int = 5000
    trained_levels: int = 1

    def __post_init__(self) -> None:
        if self.kind == "lite2" and self.begin is None:
            raise ArgumentError('kind "lite2" begins with trained weights: give begin')
        wanted = (0, 1, LEVELS) if self.light else (0, 1, 2)
        require(
            self.trained_levels in wanted,
            "trained_levels",
            self.trained_levels,
            ", ".join(map(str, wanted)),
        )
        for name in ("stem_steps", "frozen_steps"):
            require(getattr(self, name) >= 0, name, getattr(self, name), "0 or more")
        if self.learns == "mask" and self.begin is None:
            raise ArgumentError('learns = "mask" needs a network that tracks: give begin')

    @property
    def weights_path(self) -> Path | None:
        """Of the ImageNet weights, if they are not the installed package's."""
        return None if self.weights is None else Path(self.weights)

    @property
    def begin_path(self) -> Path | None:
        """Of the weights to begin with."""
        if self.begin is None:
            return None
        return SHIPPED / WEIGHTS if self.begin == "lite" else Path(self.begin)

    @property
    def stem_alone(self) -> int:
        """Number of the first steps, in which only a light stem learns."""
        alone = self.kind == "lite" and self.light and self.learns == "all"
        return self.stem_steps if alone else 0

    def frozen_levels(self, step: int) -> int:
        """Levels of the backbone that do not learn in a step."""
        frozen = step < self.frozen_steps or self.learns == "mask"
        return LEVELS if frozen else LEVELS - self.trained_levels
