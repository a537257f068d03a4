"""`Lite2Student`: the second network of `lite` while it learns."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ssiam.networks.lite2 import Lite2Network, Lite2Responses
from ssiam.networks.pretrained import load_lite2
from ssiam.training.batches import Batch
from ssiam.training.lite2_losses import lite2_losses
from ssiam.training.settings import OptimiserSettings, TrainSettings

__all__ = ["Lite2Student"]


class Lite2Student(nn.Module):
    """A network in training.

    What is computed up to stride 8 stays as it is; what follows it in the backbone learns after
    `frozen_steps`.

    Parameters
    ----------
    settings : TrainSettings
        Those of the network name weights to begin with.

    Raises
    ------
    WeightsError
        These are missing, damaged or of another network.
    """

    def __init__(self, settings: TrainSettings) -> None:
        super().__init__()
        own = settings.network
        self.network = Lite2Network(own.attention)
        assert own.begin_path is not None, "the settings ask for it"
        load_lite2(self.network, own.begin_path)
        self.network.eval().requires_grad_(False)
        self._settings = settings

    def prepare(self, step: int) -> None:
        """Free what learns in a step; to be called before every step."""
        self.network.requires_grad_(True)
        self.network.backbone.requires_grad_(False)
        for parameter in self.network.backbone.upper_parameters():
            parameter.requires_grad_(step >= self._settings.network.frozen_steps)

    def parts(self, settings: OptimiserSettings) -> list[tuple[list[nn.Parameter], float]]:
        """All parameters that ever learn, in parts with their factor of the learning rate."""
        network = self.network
        new = [*network.relation.parameters(), *network.quality.parameters()]
        return [
            (network.backbone.upper_parameters(), settings.backbone),
            (list(network.head.parameters()), settings.head),
            (new, 1.0),
        ]

    def losses(self, batch: Batch) -> dict[str, Tensor]:
        """The losses of a batch, by name."""
        return lite2_losses(self(batch), batch, self._settings)

    def forward(self, batch: Batch) -> Lite2Responses:
        """Responses of the batch's search crops to its templates and recent templates."""
        backbone = self.network.backbone
        template, search = self._lower(batch.template), self._lower(batch.search)
        kernels = self.network.kernels(backbone.upper(template))
        if batch.recent is not None and self.network.relation.blocks:
            recent = self.network.kernels(backbone.upper(self._lower(batch.recent)))[-1]
            kernels = (*kernels, recent)
        return self.network.responses(backbone.upper(search), kernels)

    @torch.no_grad()
    def _lower(self, crops: NDArray[np.uint8]) -> Tensor:
        pixels = torch.from_numpy(crops).float().contiguous(memory_format=torch.channels_last)
        return self.network.backbone.lower(pixels)
