"""Students: the networks in training, each with its losses and the parts that a step trains.

`Student.losses` freezes the parts that a step does not train, so no other call has to precede it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.networks.backbones.efficientnet_lite import STEM_LEVELS
from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.lite import LiteNetwork, LiteResponses
from ssiam.networks.lite2 import Lite2Network, Lite2Responses
from ssiam.networks.pretrained import (
    load_imagenet,
    load_lite,
    load_lite2,
    load_run_weights,
)
from ssiam.runtime import Precision, RuntimeOptions
from ssiam.runtime.openvino import supports_bf16
from ssiam.training.data.batches import SEARCH_CROP, TEMPLATE_CROP, AnyBatch, Batch, MaskBatch
from ssiam.training.distillation import (
    FeatureAdapter,
    StemDistillation,
    lite2_distillation_losses,
    lite_distillation_losses,
)
from ssiam.training.frozen_levels import FrozenLevels
from ssiam.training.losses import (
    lite2_losses,
    lite2_predictions,
    lite_losses,
    mask_losses,
    pair_labels,
)
from ssiam.training.settings import NetworkSettings, TrainSettings
from ssiam.training.teachers import NanoTrackTeacher

__all__ = [
    "AnyNetwork",
    "Lite2Student",
    "LiteStudent",
    "MaskStudent",
    "ParameterGroup",
    "Student",
    "build_network",
    "build_student",
]

AnyNetwork: TypeAlias = LiteNetwork | Lite2Network | BoxMaskNetwork
# Parameters, and their factor of the learning rate.
ParameterGroup: TypeAlias = tuple[list[nn.Parameter], float]


def build_network(settings: NetworkSettings) -> AnyNetwork:
    """The network of the settings, with random weights."""
    if settings.kind == "mask":
        return BoxMaskNetwork()
    if settings.kind == "lite2":
        return Lite2Network(settings.attention)
    return LiteNetwork(settings.blocks, light=settings.light)


def build_student(settings: TrainSettings) -> Student:
    """The student of the settings, with its initial weights.

    Raises
    ------
    MissingExtraError, WeightsError
        The initial or the teacher's weights are missing, damaged or of another network.
    """
    if settings.network.kind == "lite2":
        return Lite2Student(settings)
    if settings.network.kind == "mask":
        return MaskStudent(settings)
    return LiteStudent(settings)


class Student(nn.Module, ABC):
    """A network in training.

    Attributes
    ----------
    network : LiteNetwork, Lite2Network or BoxMaskNetwork
    """

    network: AnyNetwork

    @abstractmethod
    def losses(self, batch: AnyBatch, step: int) -> dict[str, Tensor]:
        """The weighted losses of a batch by name; only what `step` trains has gradients.

        Parameters
        ----------
        batch : Batch or MaskBatch
            The kind that the network needs.
        step : int
            Counted from 0; determines which parts are frozen.
        """

    @abstractmethod
    def parameter_groups(self) -> list[ParameterGroup]:
        """All parameters that any step trains, with their factors of the learning rate."""


@dataclass(frozen=True)
class _StemPhase:
    """Only the light stem is trained."""

    distillation: StemDistillation


@dataclass(frozen=True)
class _MainPhase:
    """The heads and the levels of the backbone after the frozen ones are trained."""

    frozen_count: int
    frozen: FrozenLevels | None  # None if no level is frozen


class LiteStudent(Student):
    """The network of `lite` in training.

    The batch normalizations of the backbone keep the statistics of its pretrained weights. Frozen
    levels are exported to OpenVINO with their current weights when a phase of training begins;
    loading a state discards the exports.

    Parameters
    ----------
    settings : TrainSettings

    Raises
    ------
    MissingExtraError, WeightsError
        The initial or the teacher's weights are missing, damaged or of another network.
    """

    network: LiteNetwork

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__()
        network, teacher = settings.network, settings.teacher
        self._settings = settings
        self._precision: Precision = "bf16" if supports_bf16() else "f32"
        self._trains_in_bf16 = _has_amx_bf16()
        self._phase: _StemPhase | _MainPhase | None = None
        self._teacher = None
        if teacher is not None:
            options = RuntimeOptions(threads=settings.threads)
            self._teacher = NanoTrackTeacher(Path(teacher.weights), options)
        self.network = LiteNetwork(network.blocks, light=network.light)
        if network.begin_path is None:
            load_imagenet(self.network.backbone, network.weights_path)
        else:
            load_lite(self.network, network.begin_path)
        self.adapter = None if teacher is None else FeatureAdapter()

    def losses(self, batch: AnyBatch, step: int) -> dict[str, Tensor]:
        """See `Student.losses`; "stem" alone while only a light stem is trained."""
        assert isinstance(batch, Batch), "batches are of the network's kind"
        if step < self._settings.network.stem_only_steps:
            phase = self._stem_phase()
            with self._autocast():
                levels = self.network.backbone.lower(_pixels(batch.search), STEM_LEVELS)
                return {"stem": phase.distillation.loss(levels, batch.search)}
        frozen = self._main_phase(step).frozen
        with self._autocast():
            template = self._levels(batch.template, frozen)
            search = self._levels(batch.search, frozen)
            responses = self.network.responses(search, self.network.kernel(template))
            adapted = None
            if self.adapter is not None:
                adapted = self.adapter(template[-1]), self.adapter(search[-1])
        # Losses are small differences of large sums and need float32.
        responses = LiteResponses(*(each.float() for each in responses))
        losses = lite_losses(responses, pair_labels(batch), self._settings.losses)
        if self._teacher is None or self._settings.teacher is None or adapted is None:
            return losses
        features = adapted[0].float(), adapted[1].float()
        teacher = self._teacher(batch.template, batch.search)
        return losses | lite_distillation_losses(
            teacher, responses, features, self._settings.teacher
        )

    def load_state_dict(self, *args: Any, **kwargs: Any) -> Any:
        """As `nn.Module.load_state_dict`; discards frozen levels exported from other weights."""
        self._phase = None
        return super().load_state_dict(*args, **kwargs)

    def parameter_groups(self) -> list[ParameterGroup]:
        """See `Student.parameter_groups`.

        A light stem has factor 1, as it is not pretrained on ImageNet.
        """
        network, factor = self._settings.network, self._settings.optimiser.backbone
        backbone = self._backbone_weights(network.frozen_levels(network.frozen_steps))
        in_backbone = {id(parameter) for parameter in self.network.backbone.parameters()}
        others = [each for each in self.parameters() if id(each) not in in_backbone]
        return [(backbone, factor), (others + self._stem_weights(), 1.0)]

    def _stem_phase(self) -> _StemPhase:
        if not isinstance(self._phase, _StemPhase):
            weights = self._settings.network.weights_path
            distillation = StemDistillation(weights, self._settings.threads, self._precision)
            self._phase = _StemPhase(distillation)
            self._train_in_backbone(self._stem_weights())
        return self._phase

    def _main_phase(self, step: int) -> _MainPhase:
        count = self._settings.network.frozen_levels(step)
        if isinstance(self._phase, _MainPhase) and self._phase.frozen_count == count:
            return self._phase
        self._phase = _MainPhase(count, self._export_levels(count) if count else None)
        if self._settings.network.learns == "mask":
            self.network.eval().requires_grad_(False)
            self.network.mask_head.train().requires_grad_(True)
        else:
            stem = [] if count else self._stem_weights()
            self._train_in_backbone([*self._backbone_weights(count), *stem])
            self.network.backbone.eval()
        return self._phase

    def _export_levels(self, count: int) -> FrozenLevels:
        sides = TEMPLATE_CROP, SEARCH_CROP
        threads = self._settings.threads
        return FrozenLevels(self.network.backbone, count, sides, threads, self._precision)

    def _levels(self, crops: NDArray[np.uint8], frozen: FrozenLevels | None) -> list[Tensor]:
        backbone = self.network.backbone
        if frozen is None:
            return backbone.lower(_pixels(crops), backbone.levels)
        return backbone.complete(frozen(crops))

    def _stem_weights(self) -> list[nn.Parameter]:
        """The parameters of the light stem, if there is one."""
        stem = self.network.backbone.stem
        return [] if stem is None else list(stem.parameters())

    def _backbone_weights(self, frozen_count: int) -> list[nn.Parameter]:
        """The parameters of the backbone after its first levels, without a light stem's."""
        deeper = range(max(frozen_count, 1), self.network.backbone.levels)
        stages = [self.network.backbone.stage_parameters(number) for number in deeper]
        return [parameter for stage in stages for parameter in stage]

    def _train_in_backbone(self, weights: list[nn.Parameter]) -> None:
        """Train these parameters of the backbone only, and everything outside of it."""
        self.train()
        self.network.backbone.requires_grad_(False)
        for parameter in weights:
            parameter.requires_grad_(True)

    def _autocast(self) -> AbstractContextManager[Any]:
        return torch.autocast("cpu", torch.bfloat16) if self._trains_in_bf16 else nullcontext()


def _has_amx_bf16() -> bool:
    """Whether the CPU has AMX for bf16; without it, gradients in bf16 take twice as long."""
    capabilities: Callable[[], dict[str, Any]] = getattr(torch.cpu, "get_capabilities", dict)
    return bool(capabilities().get("amx_bf16", False))  # older versions of PyTorch have none


class Lite2Student(Student):
    """The network of `lite2` in training.

    The backbone is frozen up to stride 8; its deeper part is trained from `frozen_steps` on. It
    trains in float32: its depthwise convolutions are slower in bf16.

    Parameters
    ----------
    settings : TrainSettings

    Raises
    ------
    WeightsError
        The weights to start from are missing, damaged or of another network.
    """

    network: Lite2Network

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__()
        begin = settings.network.begin_path
        assert begin is not None, "checked by NetworkSettings"
        self._settings = settings
        self.network = Lite2Network(settings.network.attention)
        load_lite2(self.network, begin)
        self.network.eval().requires_grad_(False)

    def losses(self, batch: AnyBatch, step: int) -> dict[str, Tensor]:
        """See `Student.losses`."""
        assert isinstance(batch, Batch), "batches are of the network's kind"
        self._freeze(step)
        predictions = lite2_predictions(self._responses(batch))
        losses = lite2_losses(predictions, pair_labels(batch), self._settings.losses)
        if batch.teacher is None or self._settings.teacher is None:
            return losses
        return losses | lite2_distillation_losses(
            batch.teacher, predictions, self._settings.teacher
        )

    def parameter_groups(self) -> list[ParameterGroup]:
        """See `Student.parameter_groups`."""
        network, factors = self.network, self._settings.optimiser
        new = [*network.relation.parameters(), *network.quality.parameters()]
        return [
            (network.backbone.upper_parameters(), factors.backbone),
            (list(network.head.parameters()), factors.head),
            (new, 1.0),
        ]

    def _freeze(self, step: int) -> None:
        self.network.requires_grad_(True)
        self.network.backbone.requires_grad_(False)
        for parameter in self.network.backbone.upper_parameters():
            parameter.requires_grad_(step >= self._settings.network.frozen_steps)

    def _responses(self, batch: Batch) -> Lite2Responses:
        backbone = self.network.backbone
        template, search = self._lower(batch.template), self._lower(batch.search)
        kernels = self.network.kernels(backbone.upper(template))
        if batch.recent is not None and self.network.relation.blocks:
            recent = self.network.kernels(backbone.upper(self._lower(batch.recent)))[-1]
            kernels = (*kernels, recent)
        return self.network.responses(backbone.upper(search), kernels)

    @torch.no_grad()
    def _lower(self, crops: NDArray[np.uint8]) -> Tensor:
        return self.network.backbone.lower(_pixels(crops))


class MaskStudent(Student):
    """The network of box masks in training; all of it is trained in every step.

    The batch normalizations of its backbone keep the statistics of ImageNet.

    Parameters
    ----------
    settings : TrainSettings

    Raises
    ------
    MissingExtraError, WeightsError
        The weights to start from are missing, damaged or of another network.
    """

    network: BoxMaskNetwork

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__()
        begin = settings.network.begin_path
        self._backbone_factor = settings.optimiser.backbone
        self.network = BoxMaskNetwork()
        if begin is None:
            load_imagenet(self.network.backbone, settings.network.weights_path)
        else:
            load_run_weights(self.network, begin)

    def losses(self, batch: AnyBatch, step: int) -> dict[str, Tensor]:
        """See `Student.losses`."""
        assert isinstance(batch, MaskBatch), "batches are of the network's kind"
        self.network.train()
        self.network.backbone.eval()
        logits = self.network(_pixels(batch.crop))[:, 0]
        return mask_losses(logits.float(), torch.from_numpy(batch.mask).float() / 255)

    def parameter_groups(self) -> list[ParameterGroup]:
        """See `Student.parameter_groups`."""
        backbone = list(self.network.backbone.parameters())
        in_backbone = {id(each) for each in backbone}
        others = [each for each in self.network.parameters() if id(each) not in in_backbone]
        return [(backbone, self._backbone_factor), (others, 1.0)]


def _pixels(crops: NDArray[np.uint8]) -> Tensor:
    """Crops (N, 3, S, S) as float32 in 0..255, channels last."""
    return torch.from_numpy(crops).float().contiguous(memory_format=torch.channels_last)
