"""`Student`: the network that learns, and how it sees a batch of pairs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.networks.efficientnet_lite import load_imagenet
from ssiam.networks.lite import LiteNetwork, LiteResponses
from ssiam.runtime import Precision
from ssiam.training.batches import SEARCH, TEMPLATE
from ssiam.training.settings import NetworkSettings
from ssiam.training.teacher import Adapter
from ssiam.training.trunk import Trunk

__all__ = ["Seen", "Student"]


class Seen(NamedTuple):
    """What the student makes of N pairs.

    Attributes
    ----------
    responses : LiteResponses
    mask : (N, 1, 64, 64)
        Logits.
    adapted : (N, 96, 8, 8) and (N, 96, 16, 16), or None
        Features of template and search crop, to be compared with a teacher's.
    """

    responses: LiteResponses
    mask: Tensor
    adapted: tuple[Tensor, Tensor] | None


class Student(nn.Module):
    """A network in training.

    The backbone keeps the statistics of its normalisations, with which its weights were trained.

    Parameters
    ----------
    settings : NetworkSettings
    taught : bool
        Whether there is a teacher whose features are to be matched.
    threads : int
        Of the frozen part.
    precision : {"f32", "bf16"}
        Likewise.
    """

    def __init__(
        self, settings: NetworkSettings, *, taught: bool, threads: int, precision: Precision
    ) -> None:
        super().__init__()
        self.network = LiteNetwork(settings.blocks)
        weights = None if settings.weights is None else Path(settings.weights)
        load_imagenet(self.network.backbone, weights)
        self.adapter = Adapter() if taught else None
        self._settings, self._threads, self._precision = settings, threads, precision
        self._trunk: Trunk | None = None

    def prepare(self, step: int) -> None:
        """Freeze and free what a step asks for; to be called before every step."""
        count = self._settings.frozen_levels(step)
        if self._trunk is not None and self._trunk.count == count:
            return
        backbone = self.network.backbone
        sides = TEMPLATE, SEARCH
        self._trunk = Trunk(backbone, count, sides, self._threads, self._precision)
        backbone.requires_grad_(False)
        for parameter in self.backbone_weights(count):
            parameter.requires_grad_(True)
        self.train()
        backbone.eval()

    def backbone_weights(self, frozen_levels: int) -> list[nn.Parameter]:
        """The parameters of the backbone after its first levels."""
        deeper = range(frozen_levels, self.network.backbone.levels)
        stages = [self.network.backbone.stage_weights(number) for number in deeper]
        return [parameter for stage in stages for parameter in stage]

    def forward(self, template: NDArray[np.uint8], search: NDArray[np.uint8]) -> Seen:
        """Responses of crops (N, 3, 127, 127) and (N, 3, 255, 255) uint8 BGR."""
        assert self._trunk is not None, "prepare comes first"
        network, trunk = self.network, self._trunk
        of_template = network.backbone.completed(trunk(template))
        of_search = network.backbone.completed(trunk(search))
        responses = network.responses(of_search, network.kernel(of_template))
        mask = network.mask(responses.response, responses.stride4)
        adapted = None
        if self.adapter is not None:
            adapted = self.adapter(of_template[-1]), self.adapter(of_search[-1])
        return Seen(responses, mask, adapted)
