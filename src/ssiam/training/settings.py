"""Settings of a training run: one frozen dataclass for each table of its TOML file.

The tables [pairs] and [[sources]] are `ssiam.training.data.settings` and
`ssiam.training.data.registry`, which do not need PyTorch. Field names are the keys of the files.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from ssiam.errors import ArgumentError
from ssiam.networks.lite import BLOCKS
from ssiam.networks.lite2 import ATTENTION_BLOCKS
from ssiam.trackers.lite import SHIPPED
from ssiam.training.data.registry import SourceSettings
from ssiam.training.data.settings import PairSettings

__all__ = [
    "WEIGHTS",
    "HeldOut",
    "LossSettings",
    "NetworkSettings",
    "OptimizerSettings",
    "TeacherSettings",
    "TrainSettings",
    "ValidationSettings",
]

WEIGHTS: Final = "weights.pth"  # in the folder of a run

_LEVELS: Final = 3  # of the backbone
# These may change when a run is resumed; a change of any other setting makes it another run.
_RESUMABLE: Final = ("workers", "threads", "checkpoint_minutes", "log_every", "validation")


@dataclass(frozen=True)
class NetworkSettings:
    """The network, its initial weights, and the parts that are trained: [network].

    Attributes
    ----------
    kind : {"lite", "lite2", "mask"}
        The network of `ssiam.networks.lite`, `ssiam.networks.lite2` or `ssiam.networks.box_mask`.
        "lite2" uses only `attention`, `begin` and `frozen_steps` of the settings below, "mask" only
        `weights` and `begin`.
    attention : int
        Attention blocks of "lite2"; 0 uses correlation only.
    blocks : int
        Blocks of the backbone, 9 to 11.
    light : bool
        Whether a light stem replaces the first two levels of the backbone.
    weights : str, optional
        File of the backbone's ImageNet weights; None for those of the installed package.
    begin : str, optional
        Weights to start from: the weights.pth of a run, with or without a light stem, or "lite" for
        the shipped weights. None starts from ImageNet weights. "lite2" needs the authors'
        nanotrackv3.pth or the weights.pth of a run.
    learns : {"all", "mask"}
        Train everything, or the mask head only, which does not change the tracking. With "mask",
        the settings below are ignored.
    stem_steps : int
        Number of the first steps, which train the light stem alone, on the features of the blocks
        that it replaces.
    frozen_steps : int
        Number of steps, including `stem_steps`, before the backbone is trained.
    trained_levels : int
        Number of levels of the backbone that are trained after that, from the deepest on: 0, 1
        (stride 16) or 2 (strides 16 and 8); with a light stem 0, 1 or 3 (all). The levels before
        them are frozen and run in OpenVINO.

    Raises
    ------
    ArgumentError
        `begin` is missing where it is needed, or a number is out of range.
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
            raise ArgumentError('kind "lite2" starts from trained weights: give begin')
        allowed = (0, 1, _LEVELS) if self.light else (0, 1, 2)
        _require(
            self.trained_levels in allowed,
            "trained_levels",
            self.trained_levels,
            ", ".join(map(str, allowed)),
        )
        for name in ("stem_steps", "frozen_steps"):
            _require(getattr(self, name) >= 0, name, getattr(self, name), "0 or more")
        if self.learns == "mask" and self.begin is None:
            raise ArgumentError('learns = "mask" needs the weights of a tracker: give begin')

    @property
    def weights_path(self) -> Path | None:
        """File of the ImageNet weights; None for those of the installed package."""
        return None if self.weights is None else Path(self.weights)

    @property
    def begin_path(self) -> Path | None:
        """File of the weights to start from; None for ImageNet weights."""
        if self.begin is None:
            return None
        return SHIPPED / WEIGHTS if self.begin == "lite" else Path(self.begin)

    @property
    def stem_only_steps(self) -> int:
        """Number of the first steps, which train a light stem alone."""
        stem_only = self.kind == "lite" and self.light and self.learns == "all"
        return self.stem_steps if stem_only else 0

    def frozen_levels(self, step: int) -> int:
        """Number of the first levels of the backbone that are frozen in a step."""
        frozen = step < self.frozen_steps or self.learns == "mask"
        return _LEVELS if frozen else _LEVELS - self.trained_levels


@dataclass(frozen=True)
class OptimizerSettings:
    """AdamW and its learning rate schedule: [optimiser].

    Attributes
    ----------
    lr : float
        Maximum learning rate.
    stem_lr : float
        Maximum learning rate of a light stem that is trained alone.
    backbone : float
        Learning rate factor of the backbone.
    head : float
        Learning rate factor of the pretrained parts of "lite2" after the backbone.
    decay : float
        Weight decay, relative to the learning rate; none for normalizations and biases.
    warm_up : int
        Steps of linear increase to `lr`; at most a tenth of all steps.
    final : float
        Factor of the learning rate at the end of the cosine.
    clip : float
        Maximum norm of the gradient.
    average : float
        Decay per step of the moving average of the weights.

    Raises
    ------
    ArgumentError
        A number is out of range.
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
        _require(self.lr > 0, "lr", self.lr, "more than 0")
        _require(0 <= self.average < 1, "average", self.average, "0 to less than 1")


@dataclass(frozen=True)
class LossSettings:
    """Kinds and weights of the losses: [losses]. A weight of 0 disables a loss.

    Attributes
    ----------
    kind_of_score : {"focal", "balanced"}
        Focal loss, or cross-entropy with equal weight of positive and negative cells.
    kind_of_box : {"giou", "log_iou"}
    score, box, quality, mask, distractor : float
        Weights. `distractor`, for "lite2" only, is a hinge loss: the best negative cell should
        score at least `margin` below the best positive one.
    margin : float
        In logits.
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
    """Distillation from NanoTrack v3 and, for "lite2", FEAR-XS: [teacher].

    Attributes
    ----------
    weights : str
        Folder of NanoTrack v3's two ONNX files.
    fear : str, optional
        Folder of FEAR-XS's two ONNX files. For each pair, "lite2" is distilled from the teacher
        whose best box has the larger overlap with the true one.
    agreement : float
        Minimum overlap (IoU) of that box with the true one, for "lite2".
    features, score, box : float
        Weights of the losses against the teacher: features at stride 16 (not of "lite2"), scores,
        and boxes where the teacher detects the target.
    """

    weights: str
    fear: str | None = None
    agreement: float = 0.6
    features: float = 1.0
    score: float = 0.5
    box: float = 0.5


@dataclass(frozen=True)
class HeldOut:
    """A dataset for validation: [[validation.held_out]].

    Attributes
    ----------
    path : str
    kind, split : str, optional
        See `ssiam.datasets.open_dataset`.
    only : tuple of str
        Patterns of the names of sequences to include; empty includes all.
    name : str
        Name in the metrics; datasets with the same name are averaged together.
    """

    path: str
    kind: str | None = None
    split: str | None = None
    only: tuple[str, ...] = ()
    name: str = ""


@dataclass(frozen=True)
class ValidationSettings:
    """Tracking of held-out sequences during training: [validation].

    Attributes
    ----------
    held_out : tuple of HeldOut
    every : int
        Steps between validations; there is always one after the last step.
    frames : int
        Maximum number of frames of each sequence.

    Raises
    ------
    ArgumentError
        `every` is below 1.
    """

    held_out: tuple[HeldOut, ...] = ()
    every: int = 5000
    frames: int = 150

    def __post_init__(self) -> None:
        _require(self.every >= 1, "every", self.every, "1 or more")


@dataclass(frozen=True)
class TrainSettings:
    """A whole training run.

    Attributes
    ----------
    sources : tuple of SourceSettings
        The training data.
    steps : int
    batch : int
        Pairs per step.
    seed : int
    workers : int
        Processes that load pairs.
    threads : int
        CPU threads of the training process. With 1, a run that is killed and resumed gives
        bit-identical weights.
    checkpoint_minutes : float
        Between checkpoints.
    log_every : int
        Steps between rows of metrics.
    pairs, network, optimiser, losses, teacher, validation
        The tables of these names.

    Raises
    ------
    ArgumentError
        A number is out of range, or the mask head would be trained with a teacher.
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
    optimiser: OptimizerSettings = field(default_factory=OptimizerSettings)
    losses: LossSettings = field(default_factory=LossSettings)
    teacher: TeacherSettings | None = None
    validation: ValidationSettings | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "threads", "log_every"):
            _require(getattr(self, name) >= 1, name, getattr(self, name), "1 or more")
        _require(self.workers >= 0, "workers", self.workers, "0 or more")
        if self.network.learns == "mask" and self.teacher is not None:
            raise ArgumentError('a teacher has no masks: leave it out with learns = "mask"')

    def identity(self) -> dict[str, Any]:
        """The settings, as plain values, that must not change when the run is resumed."""
        values = asdict(self)
        return {name: values[name] for name in values if name not in _RESUMABLE}


def _require(holds: bool, name: str, value: float, expected: str) -> None:
    if not holds:
        raise ArgumentError(f"{name} {value} of a training run: give {expected}")
