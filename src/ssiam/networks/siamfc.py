"""SiamFC: one response map by correlation (Bertinetto et al., ECCV Workshops 2016)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from torch import Tensor

from ssiam.networks.backbones.alexnet import AlexNetV1
from ssiam.networks.base import SiameseNetwork
from ssiam.networks.correlation import correlate_all, correlate_all_sliced

__all__ = ["SiamFC"]

_OUT_SCALE: Final = 0.001  # factor of the response map (siamfc-pytorch)
_SCALES: Final = 3  # search crops per call, one for each target scale


class SiamFC(SiameseNetwork):
    """SiamFC as in siamfc-pytorch: no bias after the correlation.

    Crops are RGB in 0..255, float32, not normalized.
    """

    search_shape = (_SCALES, 3, 255, 255)
    kernel_names = ("template",)
    response_names = ("response",)

    def __init__(self) -> None:
        super().__init__()
        self.backbone = AlexNetV1()

    def template(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Features (1, 256, 6, 6) of a template crop (1, 3, 127, 127), as a 1-tuple."""
        return (self.backbone(crop),)

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, ...]:
        """Response map (N, 1, 17, 17) of search crops (N, 3, 255, 255), as a 1-tuple."""
        features = self.backbone(crop)
        (kernel,) = kernels
        correlated = (correlate_all_sliced if sliced else correlate_all)(features, kernel)
        return (correlated * _OUT_SCALE,)
