"""What a training run is told: one frozen dataclass for each table of its TOML file."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Final, Literal

from ssiam.errors import ArgumentError
from ssiam.training.network_settings import NetworkSettings
from ssiam.training.opening import SourceSettings
from ssiam.training.pair_settings import PairSettings
from ssiam.training.validation_settings import ValidationSettings, require

__all__ = [
    "LossSettings",
    "OptimiserSettings",
    "TeacherSettings",
    "TrainSettings",
]

# These may differ when a run goes on; all others would make it another run.
_FREE: Final = ("workers", "threads", "checkpoint_minutes", "log_every", "validation")


@dataclass(frozen=True)
class OptimiserSettings:
    """AdamW, and how its rate goes up and down.

    Attributes
    ----------
    lr : float
        Greatest learning rate.
    stem_lr : float
        That of a light stem while it learns alone.
    backbone : float
        Factor of the backbone's rate.
    head : float
        Factor of the rate of the parts of "lite2" that begin with trained weights and follow the
        backbone.
    decay : float
        Of the weights, for each unit of the rate; normalisations and biases have none.
    warm_up : int
        Steps in which the rate rises to `lr`; a tenth of all if that is less.
    final : float
        Factor of the rate at the end of the cosine.
    clip : float
        Greatest norm of the gradient.
    average : float
        Weight of what was in the moving average of the weights, for one more step.
    """

    lr: float = 1e-3
    stem_lr: float = 2e-2
    backbone: float = 0.1
    head: float = 0.3
    decay: float = 0.02
    warm_up: int = 1000
    final: float = 0.01
    clip: float = 10.0
    average: float = 0.9995

    def __post_init__(self) -> None:
        require(self.lr > 0, "lr", self.lr, "more than 0")
        require(0 <= self.average < 1, "average", self.average, "0 to less than 1")


@dataclass(frozen=True)
class LossSettings:
    """Which losses, and their weights; a weight of 0 leaves a loss out.

    Attributes
    ----------
    kind_of_score : {"focal", "balanced"}
        Focal loss, or cross-entropy in which cells on and off the target count alike.
    kind_of_box : {"giou", "log_iou"}
    score, box, quality, mask, distractor : float
        `distractor`, of "lite2": the best cell off the target scores by less than `margin` less
        than the best one on it.
    margin : float
        Logits.
    """

    kind_of_score: Literal["focal", "balanced"] = "focal"
    kind_of_box: Literal["giou", "log_iou"] = "giou"
    score: float = 1.0
    box: float = 2.0
    quality: float = 0.5
    mask: float = 1.0
    distractor: float = 0.0
    margin: float = 3.0


@dataclass(frozen=True)
class TeacherSettings:
    """A trained NanoTrack v3 to learn from, also on pairs of weight 0; for "lite2" FEAR-XS as well.

    Attributes
    ----------
    weights : str
        Folder of its two ONNX files.
    fear : str, optional
        Folder of FEAR-XS's two ONNX files. "lite2" learns, pair by pair, from the one of the two
        whose best box agrees better with the truth.
    agreement : float
        Overlap (IoU) of that box with the truth from which "lite2" learns from it.
    features, score, box : float
        Weights of being unlike it: of the features at stride 16 (not of "lite2"), of the scores,
        and of the boxes where it sees the target.
    """

    weights: str
    fear: str | None = None
    agreement: float = 0.6
    features: float = 1.0
    score: float = 0.5
    box: float = 0.5


@dataclass(frozen=True)
class TrainSettings:
    """A whole run.

    Attributes
    ----------
    sources : tuple of SourceSettings
        Where pairs come from.
    steps : int
    batch : int
        Pairs of a step.
    seed : int
    workers : int
        Processes that draw pairs.
    threads : int
        CPU threads of the training process; with 1, a run that is killed and goes on ends with
        the same weights to the bit.
    checkpoint_minutes : float
        Between two checkpoints.
    log_every : int
        Steps between two rows of metrics.
    pairs, network, optimiser, losses, teacher, validation
        The tables of these names.
    """

    sources: tuple[SourceSettings, ...]
    steps: int = 100_000
    batch: int = 32
    seed: int = 0
    workers: int = 1
    threads: int = 1
    checkpoint_minutes: float = 5.0
    log_every: int = 50
    pairs: PairSettings = field(default_factory=PairSettings)
    network: NetworkSettings = field(default_factory=NetworkSettings)
    optimiser: OptimiserSettings = field(default_factory=OptimiserSettings)
    losses: LossSettings = field(default_factory=LossSettings)
    teacher: TeacherSettings | None = None
    validation: ValidationSettings | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "threads", "log_every"):
            require(getattr(self, name) >= 1, name, getattr(self, name), "1 or more")
        require(self.workers >= 0, "workers", self.workers, "0 or more")
        if self.network.learns == "mask" and self.teacher is not None:
            raise ArgumentError('a teacher knows no masks: leave it out where learns = "mask"')

    def identity(self) -> dict[str, Any]:
        """What makes this run this run: the values by name, of plain types."""
        values = asdict(self)
        return {name: values[name] for name in values if name not in _FREE}
