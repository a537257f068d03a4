"""SiamRPN++: scores and boxes by depthwise correlation (Li et al., CVPR 2019)."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor, nn

from ssiam.networks.backbones.alexnet import AlexNet
from ssiam.networks.backbones.mobilenet import MobileNetV2
from ssiam.networks.backbones.resnet import ResNet50
from ssiam.networks.base import SiameseNetwork
from ssiam.networks.neck import MultiLevelNeck, NoNeck
from ssiam.networks.rpn import RPN, MultiRPN

__all__ = ["SiamRPN", "siamrpn_alex", "siamrpn_mobilenet", "siamrpn_resnet"]


class SiamRPN(SiameseNetwork):
    """A Siamese region proposal network.

    Crops are BGR in 0..255, float32, not normalized.

    Parameters
    ----------
    backbone : Module
        Crop (1, 3, S, S) -> list of features, shallow to deep.
    neck : MultiLevelNeck or NoNeck
    rpn_head : MultiRPN or RPN
    search_side : int
        Side of the search crop, px: 255, or 287 for AlexNet.
    """

    response_names = ("cls", "loc")

    def __init__(
        self,
        backbone: nn.Module,
        neck: MultiLevelNeck | NoNeck,
        rpn_head: MultiRPN | RPN,
        search_side: int,
    ) -> None:
        super().__init__()
        self.search_shape = (1, 3, search_side, search_side)
        self.kernel_names = rpn_head.kernel_names
        self.backbone = backbone
        self.neck = neck
        self.rpn_head = rpn_head

    def template(self, crop: Tensor) -> tuple[Tensor, ...]:
        """Kernels (1, 256, k, k) of a template crop (1, 3, 127, 127), two per level.

        k is 5, or 4 for AlexNet.
        """
        return tuple(self.rpn_head.kernels(self.neck.template(self.backbone(crop))))

    def search(
        self, crop: Tensor, kernels: Sequence[Tensor], *, sliced: bool = False
    ) -> tuple[Tensor, ...]:
        """Raw scores (1, 10, n, n) and boxes (1, 20, n, n) of a search crop (1, 3, S, S).

        n is 25 for S = 255, and 21 for AlexNet and S = 287.
        """
        searches = self.neck.search(self.backbone(crop))
        cls, loc = self.rpn_head(searches, kernels, sliced=sliced)
        return cls, loc


def siamrpn_alex() -> SiamRPN:
    """siamrpn_alex_dwxcorr, with search crops of 287 pixels."""
    return SiamRPN(AlexNet(), NoNeck(), RPN(), 287)


def siamrpn_mobilenet() -> SiamRPN:
    """siamrpn_mobilev2_l234_dwxcorr."""
    neck = MultiLevelNeck((44, 134, 448))
    return SiamRPN(MobileNetV2((3, 5, 7)), neck, MultiRPN(weighted=False), 255)


def siamrpn_resnet(*, weighted: bool) -> SiamRPN:
    """siamrpn_r50_l234_dwxcorr if `weighted`, otherwise its OTB variant; see `MultiRPN`."""
    neck = MultiLevelNeck((512, 1024, 2048))
    return SiamRPN(ResNet50((2, 3, 4)), neck, MultiRPN(weighted=weighted), 255)
