"""`MaskStudent`: the network of masks while it learns."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.pretrained import load_imagenet, load_run_weights
from ssiam.training.losses import mask_losses
from ssiam.training.mask_crops import MaskBatch
from ssiam.training.network_settings import NetworkSettings
from ssiam.training.settings import OptimiserSettings

__all__ = ["MaskStudent"]


class MaskStudent(nn.Module):
    """A network in training; its backbone keeps the statistics of ImageNet.

    Parameters
    ----------
    settings : NetworkSettings

    Raises
    ------
    MissingExtraError, WeightsError
        The weights to begin with are not there, damaged or of another network.
    """

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.network = BoxMaskNetwork()
        if settings.begin_path is None:
            load_imagenet(self.network.backbone, settings.weights_path)
        else:
            load_run_weights(self.network, settings.begin_path)

    def prepare(self, step: int) -> None:
        """Everything learns in every step."""
        self.network.train()
        self.network.backbone.eval()

    def parts(self, settings: OptimiserSettings) -> list[tuple[list[nn.Parameter], float]]:
        """All parameters, in parts with their factor of the learning rate."""
        backbone = list(self.network.backbone.parameters())
        theirs = {id(each) for each in backbone}
        others = [each for each in self.network.parameters() if id(each) not in theirs]
        return [(backbone, settings.backbone), (others, 1.0)]

    def losses(self, batch: MaskBatch) -> dict[str, Tensor]:
        """The losses of crops, by name."""
        pixels = torch.from_numpy(batch.crop).float()
        logits = self.network(pixels.contiguous(memory_format=torch.channels_last))[:, 0]
        return mask_losses(logits.float(), torch.from_numpy(batch.mask).float() / 255)
