"""`Sight`: whether a frame shows anything where a tracker would look.

A black, white or torn frame tells nothing, but a network answers it all the same: its box drifts,
its size shrinks, and its statistics of the score are overwritten. Such a frame is not given to the
tracker at all.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image

_REACH: Final = 1.5  # target sizes on each side of the box that a search looks at
_SAMPLES: Final = 16  # along each side of what is looked at
_FINER: Final = 4  # pixels along each side that are averaged into a sample
_FLAT: Final = 6  # gray levels between the samples of what shows nothing
_ROWS: Final = 48  # of the frame that are looked at
_COLUMNS: Final = 96  # and of its columns
_APART: Final = 4  # px between two rows that are compared
_SAME: Final = 4  # gray levels by which rows that a decoder made up differ
_COVERED: Final = 0.4  # share of a box on rows that show nothing
_PATIENCE: Final = 25  # frames for which such rows are no part of the scene


class Sight:
    """Judges one frame after the other, for one target."""

    def __init__(self, frame: Image) -> None:
        """Begin with the first `frame` (H, W, 3) uint8, which shows the target."""
        self._dead = _dead_rows(frame)  # in the last frame that showed something
        self._blind = 0  # frames since then

    def shows(self, frame: Image, xywh: XYWH, *, lost: bool) -> bool:
        """Whether `frame` shows anything around the box `xywh`, raw-frame pixels.

        A target that is `lost` may be anywhere: the whole frame must be flat then.
        """
        if _flat(frame, None if lost else xywh):
            self._blind += 1
            return False
        dead = _dead_rows(frame)
        torn = dead & ~self._dead
        if torn.any() and self._blind < _PATIENCE:
            self._blind += 1
            return not _covered(torn, frame.shape[0], xywh)
        self._dead, self._blind = dead, 0
        return True


def _flat(frame: Image, xywh: XYWH | None) -> bool:
    """Whether nothing but noise is around a box, or in the whole frame."""
    height, width = frame.shape[:2]
    left, top, right, bottom = 0, 0, width, height
    if xywh is not None:
        x, y, w, h = xywh
        reach = _REACH * max(w, h)
        left, right = (int(np.clip(at, 0, width)) for at in (x - reach, x + w + reach))
        top, bottom = (int(np.clip(at, 0, height)) for at in (y - reach, y + h + reach))
        if right - left < _SAMPLES or bottom - top < _SAMPLES:
            return False  # hardly anything of it is in the frame
    step_x, step_y = (
        max((b - a) // (_SAMPLES * _FINER), 1) for a, b in ((left, right), (top, bottom))
    )
    seen = np.ascontiguousarray(frame[top:bottom:step_y, left:right:step_x])
    samples = cv2.resize(seen, (_SAMPLES, _SAMPLES), interpolation=cv2.INTER_AREA)
    down = np.ptp(samples, axis=0).max()  # 0 too where a decoder repeats a row
    return bool(down <= _FLAT)


def _dead_rows(frame: Image) -> NDArray[np.bool_]:
    """Rows that are the same as those next to them, from one side to the other; (n,) bool."""
    step_y, step_x = max(len(frame) // _ROWS, 1), max(frame.shape[1] // _COLUMNS, 1)
    last = len(frame) - _APART
    if last <= 0:
        return np.zeros(1, dtype=np.bool_)
    rows, below = frame[:last:step_y, ::step_x], frame[_APART::step_y, ::step_x]
    away = cv2.absdiff(np.ascontiguousarray(rows), np.ascontiguousarray(below))
    return np.asarray(away.max(axis=(1, 2)) <= _SAME)


def _covered(rows: NDArray[np.bool_], height: int, xywh: XYWH) -> bool:
    """Whether too much of a box lies on these rows of a frame."""
    at = (np.arange(len(rows)) + 0.5) * height / len(rows)
    own = (at >= xywh[1]) & (at <= xywh[1] + xywh[3])
    if not own.any():
        own[int(np.abs(at - xywh[1] - xywh[3] / 2).argmin())] = True
    return bool(rows[own].mean() >= _COVERED)
