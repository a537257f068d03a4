"""The moving average of a network's weights, which tracks better than the last of them."""

from __future__ import annotations

import copy
from typing import TypeAlias

import torch

from ssiam.networks.box_mask import BoxMaskNetwork
from ssiam.networks.lite import LiteNetwork
from ssiam.networks.lite2 import Lite2Network

__all__ = ["AnyNetwork", "Average"]

AnyNetwork: TypeAlias = LiteNetwork | Lite2Network | BoxMaskNetwork


class Average:
    """A network whose weights follow another one's.

    Parameters
    ----------
    network : LiteNetwork, Lite2Network or BoxMaskNetwork
        Where it starts.
    keep : float
        Weight of what was, for one more step; less of it in the first steps, so that the random
        start is soon forgotten.
    """

    def __init__(self, network: AnyNetwork, keep: float) -> None:
        self.network = copy.deepcopy(network).eval().requires_grad_(False)
        self._keep = keep

    @torch.no_grad()
    def follow(self, network: AnyNetwork, step: int) -> None:
        """Take in the weights after a step, counted from 0."""
        keep = min(self._keep, (1 + step) / (10 + step))
        for ours, theirs in zip(
            self.network.state_dict().values(), network.state_dict().values(), strict=True
        ):
            if ours.is_floating_point():
                ours.lerp_(theirs, 1 - keep)
            else:
                ours.copy_(theirs)
