"""How a light stem learns to see what the ImageNet blocks see that it stands for."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ssiam.networks.backbones.efficientnet_lite import STEM_LEVELS, EfficientNetLite0
from ssiam.networks.pretrained import load_imagenet
from ssiam.runtime import Precision
from ssiam.training.batches import SEARCH
from ssiam.training.trunk import Trunk

__all__ = ["StemLesson"]

_LEAST: Final = 1e-3  # variance of a channel that always says the same


class StemLesson:
    """The levels of strides 4 and 8 that ImageNet's own blocks make of search crops.

    Parameters
    ----------
    weights : Path, optional
        The ImageNet weights; by default those of the installed package.
    threads : int
    precision : {"f32", "bf16"}
    """

    def __init__(self, weights: Path | None, threads: int, precision: Precision) -> None:
        backbone = EfficientNetLite0().eval()
        load_imagenet(backbone, weights)
        self._trunk = Trunk(backbone, STEM_LEVELS, (SEARCH,), threads, precision)

    def loss(self, levels: list[Tensor], search: NDArray[np.uint8]) -> Tensor:
        """Share of the variance that `levels` miss, a mean over channels and levels.

        Parameters
        ----------
        levels : list of Tensor
            What the stem made of the crops: (N, 24, 64, 64) and (N, 40, 32, 32).
        search : (N, 3, 255, 255) uint8 BGR
        """
        return torch.stack(
            [
                _missed(ours.float(), theirs)
                for ours, theirs in zip(levels, self._trunk(search), strict=True)
            ]
        ).mean()


def _missed(ours: Tensor, theirs: Tensor) -> Tensor:
    every_cell = (0, 2, 3)
    variance = theirs.var(dim=every_cell).clamp(min=_LEAST)
    return ((ours - theirs).square().mean(dim=every_cell) / variance).mean()
