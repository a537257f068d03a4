"""SiamMask and SiamMask_E: SiamRPN's loop, with a mask and a rotated box in every frame.

Wang et al., SiamMask, CVPR 2019; the loop is that of STVIR/pysot, or with ``variant="siammask"``
its authors' own (foolwood/SiamMask). The mask is only an output: the next search goes by the
upright box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from ssiam.copying import DeepCopied
from ssiam.geometry import XYWH, Points, corners_from_xywh
from ssiam.runtime import Network, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.mask_boxes import Mask, ellipse_box, rectangle_box
from ssiam.trackers.mask_paste import mask_square, paste, probabilities
from ssiam.trackers.mask_windows import refinement_windows
from ssiam.trackers.siamese import TargetState, floor_overlap, kept_inside, state_at
from ssiam.trackers.siamrpn import (
    AnchorSearch,
    Found,
    SiamRpnNetworks,
    SiamRpnParameters,
)

SiamMaskName: TypeAlias = Literal[
    "siammask_r50_l3",
    "siammask_e",
    "siammask_e_unrefined",
    "siammask_vot",
    "siammask_vot18",
    "siammask_davis",
]


@dataclass(frozen=True)
class SiamMaskParameters(SiamRpnParameters):
    """What steers SiamMask.

    Parameters
    ----------
    penalty_k, window_influence, lr, instance, base, variant
        As `SiamRpnParameters`. Where the mask is empty, the corners are those of the upright
        box, which in the "siammask" variant is not yet kept inside of the frame.
    mask_threshold : float
        Probability above which a pixel belongs to the target.
    fit : {"rectangle", "ellipse"}
        The rotated box: the smallest one around the mask, or SiamMask_E's.
    factor : float, optional
        SiamMask_E's alpha, with which its box is refined; None leaves the refinement out.
    """

    mask_threshold: float = 0.3
    fit: Literal["rectangle", "ellipse"] = "rectangle"
    factor: float | None = None


PARAMETERS: Final[dict[SiamMaskName, SiamMaskParameters]] = {
    "siammask_r50_l3": SiamMaskParameters(0.10, 0.41, 0.32, mask_threshold=0.15),
    "siammask_e": SiamMaskParameters(
        0.0997, 0.4099, 0.32, mask_threshold=0.1465, fit="ellipse", factor=0.2583
    ),
    "siammask_e_unrefined": SiamMaskParameters(
        0.0997, 0.4099, 0.32, mask_threshold=0.1465, fit="ellipse"
    ),
    "siammask_vot": SiamMaskParameters(0.04, 0.42, 0.25, variant="siammask", mask_threshold=0.30),
    "siammask_vot18": SiamMaskParameters(0.10, 0.41, 0.32, variant="siammask", mask_threshold=0.15),
    "siammask_davis": SiamMaskParameters(0.04, 0.40, 1.0, variant="siammask", mask_threshold=0.35),
}


@dataclass(frozen=True)
class SiamMaskNetworks(SiamRpnNetworks):
    """The three networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` and `search` as `SiamRpnNetworks`; after the two maps `search` also gives the
    correlation (1, 256, 25, 25) and the backbone's x0 (1, 64, 125, 125), p1 (1, 256, 63, 63) and
    p2 (1, 512, 31, 31). `refine` takes windows of x0, p1 and p2 and the correlation of one cell,
    as `refinement_windows` cuts them, and gives logits (1, 127 * 127).
    """

    refine: Network


class SiamMask(DeepCopied):
    """SiamMask's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Parameters
    ----------
    networks : SiamMaskNetworks
    parameters : SiamMaskParameters
    """

    doubt = 0.0

    def __init__(self, networks: SiamMaskNetworks, parameters: SiamMaskParameters) -> None:
        self._networks = networks
        self._parameters = parameters
        self._search = AnchorSearch(networks, parameters)

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the target in `xywh` as the one to follow."""
        self._state = self._search.start(view, xywh)

    def track(self, view: FrameView) -> Track:
        """The target in the next view, with mask and corners; the score is as in `SiamRpn`."""
        last = self._state
        found = self._search.find(view, last)
        self._state = kept_inside(found.state, view)
        # A steadied view shows parts of the raw frame beyond its own edges.
        margin = 0 if view.is_raw else view.border
        pasted = self._pasted(found, last, view.size_wh, margin)
        mask = pasted > self._parameters.mask_threshold
        width, height = view.size_wh
        return Track(
            self._state.xywh,
            score=found.score * floor_overlap(self._state, found.size_wh),
            corners=self._corners(mask, margin, found.state),
            mask=mask[margin : margin + height, margin : margin + width],
        )

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`."""
        self._state = state_at(xywh)
        return self.track(view)

    def another(self) -> SiamMask:
        """A second tracker on the same networks."""
        return SiamMask(self._networks, self._parameters)

    def _pasted(
        self, found: Found, last: TargetState, size_wh: tuple[int, int], margin: int
    ) -> Tensor:
        """Probability of the target for every pixel of the view and its margin."""
        corr, *features = found.more
        windows = refinement_windows(corr, features, found.cell)
        (logits,) = self._networks.refine(*windows)
        instance, base = self._parameters.instance, self._parameters.base
        square = mask_square(last.center_xy, found.crop_side, found.cell, instance, base)
        return paste(probabilities(logits), square, size_wh, margin)

    def _corners(self, mask: Mask, margin: int, unkept: TargetState) -> Points:
        """Rotated box of the mask in the view's pixels, or the upright box if there is none."""
        if self._parameters.fit == "ellipse":
            box = ellipse_box(mask, self._parameters.factor)
        else:
            box = rectangle_box(mask)
        if box is not None:
            return box - margin
        state = unkept if self._parameters.variant == "siammask" else self._state
        return corners_from_xywh(state.xywh)
