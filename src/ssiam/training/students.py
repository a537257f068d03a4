"""Students: the networks in training, each with its losses and the parts that a step trains.

`Student.losses` freezes the parts that a step does not train, so no other call has to precede it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.lite import LiteNetwork, LiteResponses
from ssiam.networks.pretrained import load_imagenet, load_lite, load_run_weights
from ssiam.training.data.batches import AnyBatch, Batch, MaskBatch
from ssiam.training.depthwise import FastDepthwiseGradients
from ssiam.training.losses import (
    distillation_losses,
    lite_losses,
    mask_losses,
    pair_labels,
    predictions_of,
)
from ssiam.training.settings import NetworkSettings, TrainSettings

__all__ = [
    "AnyNetwork",
    "LiteStudent",
    "MaskStudent",
    "ParameterGroup",
    "Student",
    "build_network",
    "build_student",
]

AnyNetwork: TypeAlias = LiteNetwork | BoxMaskNetwork
# Parameters, and their factor of the learning rate.
ParameterGroup: TypeAlias = tuple[list[nn.Parameter], float]


def build_network(settings: NetworkSettings) -> AnyNetwork:
    """The network of the settings, with random weights."""
    if settings.kind == "mask":
        return BoxMaskNetwork()
    return LiteNetwork(settings.attention)


def build_student(settings: TrainSettings) -> Student:
    """The student of the settings, with its initial weights.

    Raises
    ------
    MissingExtraError, WeightsError
        The initial or the teacher's weights are missing, damaged or of another network.
    """
    return MaskStudent(settings) if settings.network.kind == "mask" else LiteStudent(settings)


class Student(nn.Module, ABC):
    """A network in training.

    Attributes
    ----------
    network : LiteNetwork or BoxMaskNetwork
    """

    network: AnyNetwork

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__()
        self._settings = settings

    @property
    def device(self) -> torch.device:
        """The device of the network."""
        return next(self.network.parameters()).device

    @contextmanager
    def arithmetic(self) -> Iterator[None]:
        """A context for the forward pass: the precision of the settings, and faster gradients."""
        mixed = self._settings.precision == "bf16"
        autocast = torch.autocast(self.device.type, torch.bfloat16) if mixed else nullcontext()
        with FastDepthwiseGradients(), autocast:
            yield

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


class LiteStudent(Student):
    """The network of `lite` in training.

    The backbone is frozen up to stride 8; its deeper part is trained from `frozen_steps` on.

    Parameters
    ----------
    settings : TrainSettings

    Raises
    ------
    WeightsError
        The weights to start from are missing, damaged or of another network.
    """

    network: LiteNetwork

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__(settings)
        begin = settings.network.begin_path
        assert begin is not None, "checked by NetworkSettings"
        self.network = LiteNetwork(settings.network.attention)
        load_lite(self.network, begin)
        self.network.eval().requires_grad_(False)

    def losses(self, batch: AnyBatch, step: int) -> dict[str, Tensor]:
        """See `Student.losses`."""
        assert isinstance(batch, Batch), "batches are of the network's kind"
        self._freeze(step)
        with self.arithmetic():
            responses = self._responses(batch)
        predictions = predictions_of(LiteResponses(*(each.float() for each in responses)))
        losses = lite_losses(predictions, pair_labels(batch, self.device), self._settings.losses)
        if batch.teacher is None or self._settings.teacher is None:
            return losses
        return losses | distillation_losses(batch.teacher, predictions, self._settings.teacher)

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

    def _responses(self, batch: Batch) -> LiteResponses:
        backbone = self.network.backbone
        template, search = self._lower(batch.template), self._lower(batch.search)
        kernels = self.network.kernels(backbone.upper(template))
        if batch.recent is not None and self.network.relation.blocks:
            recent = self.network.kernels(backbone.upper(self._lower(batch.recent)))[-1]
            kernels = (*kernels, recent)
        return self.network.responses(backbone.upper(search), kernels)

    @torch.no_grad()
    def _lower(self, crops: NDArray[np.uint8]) -> Tensor:
        return self.network.backbone.lower(_pixels(crops, self.device))


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
        super().__init__(settings)
        begin = settings.network.begin_path
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
        with self.arithmetic():
            logits = self.network(_pixels(batch.crop, self.device))[:, 0]
        mask = torch.from_numpy(batch.mask).to(self.device)
        return mask_losses(logits.float(), mask.float() / 255)

    def parameter_groups(self) -> list[ParameterGroup]:
        """See `Student.parameter_groups`."""
        backbone = list(self.network.backbone.parameters())
        in_backbone = {id(each) for each in backbone}
        others = [each for each in self.network.parameters() if id(each) not in in_backbone]
        return [(backbone, self._settings.optimiser.backbone), (others, 1.0)]


def _pixels(crops: NDArray[np.uint8], device: torch.device) -> Tensor:
    """Crops (N, 3, S, S) on a device as float32 in 0..255, channels last."""
    pixels = torch.from_numpy(crops).to(device)
    return pixels.float().contiguous(memory_format=torch.channels_last)
