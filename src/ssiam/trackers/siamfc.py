"""SiamFC: one correlation map at three scales, on any frame view.

Bertinetto et al., "Fully-Convolutional Siamese Networks for Object Tracking" (2016); the loop is
that of huanglianghua/siamfc-pytorch, in its single precision, which decides some roundings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.geometry import XYWH
from ssiam.runtime import Network, Tensor
from ssiam.stabilize import FrameView
from ssiam.track import Track
from ssiam.trackers.crops import siamfc_crop
from ssiam.trackers.siamese import CONTEXT, EXEMPLAR, Floats, crop_tensor

SiamFcName: TypeAlias = Literal["siamfc"]
Singles = NDArray[np.float32]

_SEARCH: Final = 255  # px, side of the search crop
_STRIDE: Final = 8  # px of the search crop between cells of the response
_UP: Final = 16  # finer cells in one cell of the response
_FINE: Final = 17 * _UP  # side of the upsampled response
_SMALLEST: Final = 2.0  # px, the target's shorter side


@dataclass(frozen=True)
class SiamFcParameters:
    """What steers SiamFC; the authors' numbers for all benchmarks.

    Parameters
    ----------
    scale_step : float
        Ratio between neighbouring scales that are searched.
    scale_lr : float
        How fast the size follows the best scale, 0..1.
    scale_penalty : float
        Factor on the responses of the scales that are not the last one.
    window_influence : float
        Weight 0..1 of the cosine window, which prefers places near the last one.
    """

    scale_step: float = 1.0375
    scale_lr: float = 0.59
    scale_penalty: float = 0.9745
    window_influence: float = 0.176


@dataclass(frozen=True)
class SiamFcNetworks:
    """The two networks, which any number of trackers may share.

    Threads: any number may share it.

    `template` takes (1, 3, 127, 127) float32 **RGB** in 0..255 and gives a kernel
    (1, 256, 6, 6); `search` takes three crops (3, 3, 255, 255) and the kernel, and gives
    responses (3, 1, 17, 17).
    """

    template: Network
    search: Network


class SiamFc(DeepCopied):
    """SiamFC's loop.

    Threads: one thread at a time for each object; several objects do not disturb each other.

    Unlike the reference, a target stops shrinking below 2 pixels and growing beyond the frame:
    there it fails on an empty crop, or on one that fills the memory.

    Parameters
    ----------
    networks : SiamFcNetworks
    parameters : SiamFcParameters, optional
    """

    doubt = 0.0

    def __init__(
        self, networks: SiamFcNetworks, parameters: SiamFcParameters | None = None
    ) -> None:
        self._networks = networks
        self._parameters = parameters or SiamFcParameters()
        self._factors: Floats = self._parameters.scale_step ** np.array([-1.0, 0.0, 1.0])
        penalty = self._parameters.scale_penalty
        self._penalties = np.array([penalty, 1, penalty], np.float32)[:, None, None]
        hanning = np.hanning(_FINE)
        window = np.outer(hanning, hanning)
        self._window: Floats = window / window.sum()

    def init(self, view: FrameView, xywh: XYWH) -> None:
        """Take the template from `xywh`; the frame's mean colour fills what is outside."""
        centre, size = _centre_and_size(xywh)
        fill: Floats = view.raw.mean(axis=(0, 1))[::-1]
        crop = siamfc_crop(view, centre, float(_template_side(size)), EXEMPLAR, fill)
        (kernel,) = self._networks.template(crop_tensor(crop))
        self._kernel, self._fill = kernel, fill
        self._place(xywh)

    def track(self, view: FrameView) -> Track:
        """The target in the next view.

        The score is the sigmoid of the response at the chosen place, the probability that the
        network's logistic loss was trained for.
        """
        fine = self._responses(view)
        scale = int(np.argmax((fine * self._penalties).max(axis=(1, 2))))
        row, column = self._peak(fine[scale] * self._penalties[scale])
        score = float((1 + np.tanh(float(fine[scale, row, column]) / 2)) / 2)
        self._move(np.array([column, row]), float(self._factors[scale]))
        self._resize(float(self._factors[scale]), view.size_wh)
        return Track(self._xywh, score=score)

    def seek(self, view: FrameView, xywh: XYWH) -> Track:
        """The target in this view, looked for around `xywh`."""
        self._place(xywh)
        return self.track(view)

    def another(self) -> SiamFc:
        """A second tracker on the same networks."""
        return SiamFc(self._networks, self._parameters)

    @property
    def _xywh(self) -> XYWH:
        cx, cy, w, h = (float(v) for v in (*self._centre, *self._size))
        return cx - (w - 1) / 2, cy - (h - 1) / 2, w, h

    def _place(self, xywh: XYWH) -> None:
        """Set position and size to those of `xywh`."""
        self._centre, self._size = _centre_and_size(xywh)
        side = _template_side(self._size)
        self._search_side = float(side * np.float32(_SEARCH) / np.float32(EXEMPLAR))

    def _responses(self, view: FrameView) -> Tensor:
        """Responses (3, 272, 272) around the last place, at the three scales."""
        crops = [
            crop_tensor(siamfc_crop(view, self._centre, side, _SEARCH, self._fill))
            for side in self._search_side * self._factors
        ]
        (responses,) = self._networks.search(np.concatenate(crops), self._kernel)
        fine = [
            cv2.resize(each, (_FINE, _FINE), interpolation=cv2.INTER_CUBIC)
            for each in responses[:, 0]
        ]
        return np.asarray(fine, dtype=np.float32)

    def _peak(self, response: Tensor) -> tuple[int, int]:
        """Row and column of the best place in a fine response, with the cosine window."""
        above = response - response.min()
        share = above / (above.sum() + np.float32(1e-16))
        influence = self._parameters.window_influence
        ranked = np.float32(1 - influence) * share + influence * self._window
        row, column = divmod(int(ranked.argmax()), _FINE)
        return row, column

    def _move(self, peak_xy: NDArray[np.int_], factor: float) -> None:
        """Take over the place of the peak in a search region of `factor` times the side."""
        in_crop = (peak_xy - (_FINE - 1) / 2) * _STRIDE / _UP
        shift = in_crop * self._search_side * factor / _SEARCH
        self._centre = (self._centre.astype(np.float64) + shift).astype(np.float32)

    def _resize(self, factor: float, size_wh: tuple[int, int]) -> None:
        """Follow the scale of the best response, within what can be searched."""
        rate = self._parameters.scale_lr
        scale = (1 - rate) + rate * factor
        size = self._size.astype(np.float64) * scale
        too_small = scale < 1 and size.min() < _SMALLEST
        too_large = scale > 1 and (size > size_wh).any()
        if not too_small and not too_large:
            self._size = size.astype(np.float32)
            self._search_side *= scale


def _centre_and_size(xywh: XYWH) -> tuple[Singles, Singles]:
    x, y, w, h = xywh
    centre = np.array([x + (w - 1) / 2, y + (h - 1) / 2], np.float32)
    return centre, np.array([w, h], np.float32)


def _template_side(size: Singles) -> np.float32:
    """Side of the template crop of a target of (width, height), unrounded pixels."""
    padded = size + np.float32(CONTEXT) * size.sum()
    return np.float32(np.sqrt(np.prod(padded)))
