"""Settings of a training run: one frozen dataclass for each table of its TOML file.

The tables [pairs] and [[sources]] are `ssiam.training.data.settings` and
`ssiam.training.data.registry`, which do not need PyTorch. Field names are the keys of the files.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

from ssiam.errors import ArgumentError
from ssiam.networks.lite import ATTENTION_BLOCKS
from ssiam.trackers.lite import SHIPPED
from ssiam.training.data.registry import SourceSettings
from ssiam.training.data.settings import PairSettings

__all__ = [
    "MASK_WEIGHTS",
    "SHIPPED_NAME",
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
SHIPPED_NAME: Final = "lite"  # of the shipped weights, in `begin`
MASK_WEIGHTS: Final = "mask.pth"  # of the mask network, in the folder of the shipped weights

# These may change when a run is resumed; a change of any other setting makes it another run.
_RESUMABLE: Final = ("workers", "threads", "checkpoint_minutes", "log_every", "validation")


@dataclass(frozen=True)
class NetworkSettings:
    """The network, its initial weights, and the parts that are trained: [network].

    Attributes
    ----------
    kind : {"lite", "mask"}
        The network of `ssiam.networks.lite` or `ssiam.networks.box_mask`.
    begin : str, optional
        Weights to start from: "lite" for the shipped weights, or the weights.pth of a run; for the
        network of "lite" also the authors' nanotrackv3.pth. "mask" starts from ImageNet weights
        without it.
    weights : str, optional
        For "mask": file of the backbone's ImageNet weights; None for those of the installed
        package.
    attention : int
        For "lite": number of attention blocks; 0 uses correlation only.
    frozen_steps : int
        For "lite": number of steps before the backbone is trained from stride 8 to 16.

    Raises
    ------
    ArgumentError
        `begin` is missing where it is needed, or a number is out of range.
    """

    kind: Literal["lite", "mask"] = "lite"
    begin: str | None = None
    weights: str | None = None
    attention: int = ATTENTION_BLOCKS
    frozen_steps: int = 0

    def __post_init__(self) -> None:
        if self.kind == "lite" and self.begin is None:
            raise ArgumentError(
                'kind "lite" starts from trained weights: give begin = "lite" or a file'
            )
        for name in ("attention", "frozen_steps"):
            _require(getattr(self, name) >= 0, name, getattr(self, name), "0 or more")

    @property
    def weights_path(self) -> Path | None:
        """File of the ImageNet weights; None for those of the installed package."""
        return None if self.weights is None else Path(self.weights)

    @property
    def begin_path(self) -> Path | None:
        """File of the weights to start from; None for ImageNet weights."""
        if self.begin is None:
            return None
        if self.begin == SHIPPED_NAME:
            return SHIPPED / (MASK_WEIGHTS if self.kind == "mask" else WEIGHTS)
        return Path(self.begin)


@dataclass(frozen=True)
class OptimizerSettings:
    """AdamW and its learning rate schedule: [optimiser].

    Attributes
    ----------
    lr : float
        Maximum learning rate.
    backbone : float
        Learning rate factor of the backbone.
    head : float
        Learning rate factor of the pretrained parts of "lite" after the backbone.
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
    """Kinds and weights of the losses of "lite": [losses]. A weight of 0 disables a loss.

    Attributes
    ----------
    kind_of_score : {"focal", "balanced"}
        Focal loss, or cross-entropy with equal weight of positive and negative cells.
    kind_of_box : {"giou", "log_iou"}
    score, box, quality, distractor : float
        Weights. `distractor` is a hinge loss: the best negative cell should score at least `margin`
        below the best positive one.
    margin : float
        In logits.
    """

    kind_of_score: Literal["focal", "balanced"] = "focal"
    kind_of_box: Literal["giou", "log_iou"] = "giou"
    score: float = 1.0
    box: float = 2.0
    quality: float = 0.5
    distractor: float = 0.0
    margin: float = 3.0


@dataclass(frozen=True)
class TeacherSettings:
    """Distillation of "lite" from NanoTrack v3 and FEAR-XS: [teacher].

    Attributes
    ----------
    weights : str
        Folder of NanoTrack v3's two ONNX files.
    fear : str, optional
        Folder of FEAR-XS's two ONNX files. For each pair, the teacher is the one whose best box
        has the larger overlap with the true one.
    agreement : float
        Minimum overlap (IoU) of that box with the true one.
    score, box : float
        Weights of the losses against the teacher: scores, and boxes where the teacher detects the
        target.
    """

    weights: str
    fear: str | None = None
    agreement: float = 0.6
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
    relative : bool
        Whether paths are relative to the settings' file instead of the working directory.
    precision : {"f32", "bf16"}
        Arithmetic of the network in training; weights, losses and the optimizer are always float32.
        bf16 is faster on GPUs and on CPUs that support it.
    pairs, network, optimiser, losses, teacher, validation
        The tables of these names.

    Raises
    ------
    ArgumentError
        A number is out of range.
    """

    sources: tuple[SourceSettings, ...]
    steps: int = 100_000
    batch: int = 32
    seed: int = 0
    workers: int = 1
    threads: int = 1
    checkpoint_minutes: float = 5.0
    log_every: int = 50
    relative: bool = False
    precision: Literal["f32", "bf16"] = "f32"
    pairs: PairSettings = field(default_factory=PairSettings)
    network: NetworkSettings = field(default_factory=lambda: NetworkSettings(begin="lite"))
    optimiser: OptimizerSettings = field(default_factory=OptimizerSettings)
    losses: LossSettings = field(default_factory=LossSettings)
    teacher: TeacherSettings | None = None
    validation: ValidationSettings | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "threads", "log_every"):
            _require(getattr(self, name) >= 1, name, getattr(self, name), "1 or more")
        _require(self.workers >= 0, "workers", self.workers, "0 or more")

    def located(self, root: Path | None) -> TrainSettings:
        """The settings with all paths joined to a folder, their base; None changes nothing."""
        if root is None:
            return self
        sources = tuple(
            replace(
                each,
                path=_joined(root, each.path),
                backgrounds=tuple(_joined(root, folder) for folder in each.backgrounds),
            )
            for each in self.sources
        )
        begin, weights = self.network.begin, self.network.weights
        network = replace(
            self.network,
            begin=begin if begin in (None, SHIPPED_NAME) else _joined(root, begin),
            weights=None if weights is None else _joined(root, weights),
        )
        teacher, validation = self.teacher, self.validation
        if teacher is not None:
            fear = None if teacher.fear is None else _joined(root, teacher.fear)
            teacher = replace(teacher, weights=_joined(root, teacher.weights), fear=fear)
        if validation is not None:
            held_out = tuple(
                replace(each, path=_joined(root, each.path)) for each in validation.held_out
            )
            validation = replace(validation, held_out=held_out)
        return replace(
            self, sources=sources, network=network, teacher=teacher, validation=validation
        )

    def identity(self) -> dict[str, Any]:
        """The settings, as plain values, that must not change when the run is resumed."""
        values = asdict(self)
        return {name: values[name] for name in values if name not in _RESUMABLE}


def _joined(root: Path, path: str) -> str:
    return str(root / path)


def _require(holds: bool, name: str, value: float, expected: str) -> None:
    if not holds:
        raise ArgumentError(f"{name} {value} of a training run: give {expected}")
