"""`Student`: the network that learns, and how it sees a batch of pairs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.networks.backbones.efficientnet_lite import STEM_LEVELS
from ssiam.networks.lite import LiteNetwork, LiteResponses
from ssiam.networks.pretrained import load_imagenet, load_lite
from ssiam.runtime import Precision
from ssiam.training.batches import SEARCH, TEMPLATE
from ssiam.training.network_settings import NetworkSettings
from ssiam.training.stem import StemLesson
from ssiam.training.teacher import Adapter
from ssiam.training.trunk import Trunk

__all__ = ["Seen", "Student"]


class Seen(NamedTuple):
    """What the student makes of N pairs.

    Attributes
    ----------
    responses : LiteResponses
    adapted : (N, 96, 8, 8) and (N, 96, 16, 16), or None
        Features of template and search crop, to be compared with a teacher's.
    """

    responses: LiteResponses
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
        self.network = LiteNetwork(settings.blocks, light=settings.light)
        if settings.begin_path is None:
            load_imagenet(self.network.backbone, settings.weights_path)
        else:
            load_lite(self.network, settings.begin_path)
        self.adapter = Adapter() if taught else None
        self._settings, self._threads, self._precision = settings, threads, precision
        self._frozen: int | None = None
        self._trunk: Trunk | None = None
        self._lesson: StemLesson | None = None

    def prepare(self, step: int) -> None:
        """Freeze and free what a step asks for; to be called before every step."""
        if step < self._settings.stem_alone:
            self._prepare_stem()
            return
        frozen = self._settings.frozen_levels(step)
        if self._frozen == frozen:
            return
        backbone = self.network.backbone
        self._frozen, self._lesson, self._trunk = frozen, None, None
        if frozen:
            sides = TEMPLATE, SEARCH
            self._trunk = Trunk(backbone, frozen, sides, self._threads, self._precision)
        if self._settings.learns == "mask":
            self._free_mask()
            return
        self._free([*self.backbone_weights(frozen), *([] if frozen else self.stem_weights())])
        backbone.eval()

    def stem_weights(self) -> list[nn.Parameter]:
        """The parameters of the light stem, if there is one."""
        stem = self.network.backbone.stem
        return [] if stem is None else list(stem.parameters())

    def backbone_weights(self, frozen_levels: int) -> list[nn.Parameter]:
        """The parameters of the backbone after its first levels, without a light stem's."""
        deeper = range(max(frozen_levels, 1), self.network.backbone.levels)
        stages = [self.network.backbone.stage_parameters(number) for number in deeper]
        return [parameter for stage in stages for parameter in stage]

    def stem_loss(self, search: NDArray[np.uint8]) -> Tensor:
        """What the stem misses of crops (N, 3, 255, 255) uint8 BGR, see `StemLesson`."""
        assert self._lesson is not None, "prepare comes first"
        levels = self.network.backbone.lower(_crops(search), STEM_LEVELS)
        return self._lesson.loss(levels, search)

    def forward(self, template: NDArray[np.uint8], search: NDArray[np.uint8]) -> Seen:
        """Responses of crops (N, 3, 127, 127) and (N, 3, 255, 255) uint8 BGR."""
        of_template, of_search = self._levels(template), self._levels(search)
        responses = self.network.responses(of_search, self.network.kernel(of_template))
        adapted = None
        if self.adapter is not None:
            adapted = self.adapter(of_template[-1]), self.adapter(of_search[-1])
        return Seen(responses, adapted)

    def _levels(self, crops: NDArray[np.uint8]) -> list[Tensor]:
        assert self._frozen is not None, "prepare comes first"
        backbone = self.network.backbone
        if self._trunk is None:
            return backbone.lower(_crops(crops), backbone.levels)
        return backbone.complete(self._trunk(crops))

    def _prepare_stem(self) -> None:
        if self._lesson is not None:
            return
        weights = self._settings.weights_path
        self._lesson = StemLesson(weights, self._threads, self._precision)
        self._free(self.stem_weights())

    def _free_mask(self) -> None:
        """Let the mask head learn, and nothing else."""
        self.network.eval().requires_grad_(False)
        self.network.mask_head.train().requires_grad_(True)

    def _free(self, weights: list[nn.Parameter]) -> None:
        """Let the backbone learn these of its weights, and no others."""
        self.train()
        self.network.backbone.requires_grad_(False)
        for parameter in weights:
            parameter.requires_grad_(True)


def _crops(crops: NDArray[np.uint8]) -> Tensor:
    return torch.from_numpy(crops).float().contiguous(memory_format=torch.channels_last)
