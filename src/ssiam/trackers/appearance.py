"""`Appearance`: how the target looked, for trackers that cannot tell whether they still have it.

A few hundred averaged pixels of the first box and of the last one believed in, compared by their
normalised correlation.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image
from ssiam.stabilize import FrameView

_SAMPLES: Final = 16  # along the geometric mean of the target's sides
_FEWEST, _MOST = 6, 48  # samples along one side
_FINER: Final = 2  # finer samples along each side that are averaged into one
_PLAY: Final = 2  # samples by which a box may be off
_TELLING: Final = 1.0  # grey levels, standard deviation of a look that tells something


class Appearance:
    """The target's first look and its recent one.

    Parameters
    ----------
    view : FrameView
    xywh : (x, y, w, h)
        The target in it, steadied pixels.
    """

    def __init__(self, view: FrameView, xywh: XYWH) -> None:
        _, _, w, h = xywh
        per_pixel = _SAMPLES / np.sqrt(w * h)
        self._grid = tuple(int(np.clip(round(s * per_pixel), _FEWEST, _MOST)) for s in (w, h))
        self._first = self._recent = self._sampled(view, xywh, 0)

    def learn(self, view: FrameView, xywh: XYWH) -> None:
        """Take what is in `xywh` as the recent look."""
        self._recent = self._sampled(view, xywh, 0)

    def likeness(self, view: FrameView, xywh: XYWH) -> tuple[float, float]:
        """Correlation -1..1 of what is in `xywh` with the first and with the recent look."""
        window = self._sampled(view, xywh, _PLAY)
        first, recent = self._compared(window)
        return float(first.max()), float(recent.max())

    def find(self, view: FrameView, xywh: XYWH, reach: float) -> XYWH:
        """The place most like the target within `reach` target sizes of `xywh`."""
        play = round(reach * _SAMPLES)
        maps = np.maximum(*self._compared(self._sampled(view, xywh, play)))
        row, column = np.unravel_index(int(maps.argmax()), maps.shape)
        x, y, w, h = xywh
        across, down = self._grid
        return x + (int(column) - play) * w / across, y + (int(row) - play) * h / down, w, h

    def _compared(self, window: Image) -> list[NDArray[np.float32]]:
        return [_correlation(window, look) for look in (self._first, self._recent)]

    def _sampled(self, view: FrameView, xywh: XYWH, play: int) -> Image:
        """The box, and `play` samples more on each side: (rows, columns, 3) uint8."""
        x, y, w, h = xywh
        across, down = self._grid
        step_x, step_y = w / across / _FINER, h / down / _FINER
        left, top = x - play * w / across, y - play * h / down
        stab_from_samples = np.array(
            [
                [step_x, 0, left + step_x / 2 - 0.5],
                [0, step_y, top + step_y / 2 - 0.5],
                [0, 0, 1],
            ]
        )
        columns, rows = across + 2 * play, down + 2 * play
        fine = cv2.warpAffine(
            view.raw,
            (view.raw_from_stab @ stab_from_samples)[:2],
            (columns * _FINER, rows * _FINER),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
        )
        sampled = cv2.resize(fine, (columns, rows), interpolation=cv2.INTER_AREA)
        return np.asarray(sampled, dtype=np.uint8)


def _correlation(window: Image, look: Image) -> NDArray[np.float32]:
    """How much each place in a window is like a look, -1..1; 0 if the look tells nothing."""
    found = cv2.matchTemplate(window, look, cv2.TM_CCOEFF_NORMED)
    return np.asarray(np.nan_to_num(found) if look.std() >= _TELLING else 0 * found, np.float32)
