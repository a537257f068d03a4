"""`BlankFrameDetector`: finds frames that show nothing to track.

A network returns a box for a black, white or torn frame too: the box drifts, its size shrinks, and
the running mean of the score is corrupted. Such frames are therefore not passed to the tracker.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.geometry import XYWH, Image

_REACH: Final = 1.5  # margin of the checked area around the box, in longer sides of the box
_SAMPLES: Final = 16  # samples along each side of the checked area
_PIXELS_PER_SAMPLE: Final = 4  # pixels along each side that are averaged into one sample
_FLAT: Final = 6  # gray levels, maximum range of the samples of a flat area
_ROWS: Final = 48  # rows of the frame that are compared with the row below
_COLUMNS: Final = 96  # columns of these rows that are compared
_ROW_DISTANCE: Final = 4  # px between two compared rows
_SAME_ROW: Final = 4  # gray levels, maximum difference of two rows that a decoder has repeated
_COVERED: Final = 0.4  # share of torn rows in the box from which the target is not visible
_PIXEL: Final = np.dtype("V3")  # three channels of 8 bits
_PATIENCE: Final = 25  # blank frames after which torn rows are accepted as part of the scene


class BlankFrameDetector:
    """Finds blank frames in the video of one target.

    Parameters
    ----------
    frame : (H, W, 3) uint8
        The first frame, which shows the target.
    """

    def __init__(self, frame: Image) -> None:
        self._repeated_rows = _repeated_rows(frame)  # of the last frame that was not blank
        self._frames_blank = 0  # consecutive frames before this one
        self._prepared: tuple[Image, NDArray[np.bool_]] | None = None

    def prepare(self, frame: Image) -> None:
        """Do what `is_blank` needs of the next frame without its box; from any thread."""
        self._prepared = frame, _repeated_rows(frame)

    def is_blank(self, frame: Image, xywh: XYWH, *, lost: bool) -> bool:
        """Whether `frame` is blank around the box `xywh`; to be called once for each frame.

        Parameters
        ----------
        frame : (H, W, 3) uint8
        xywh : (x, y, w, h)
            Raw-frame pixels.
        lost : bool
            Whether the target is lost. It may then be anywhere, so a frame is blank only if it is
            flat everywhere.
        """
        prepared, self._prepared = self._prepared, None
        if _is_flat(frame, None if lost else xywh):
            self._frames_blank += 1
            return True
        if prepared is None or prepared[0] is not frame:
            prepared = frame, _repeated_rows(frame)
        repeated = prepared[1]
        torn = repeated & ~self._repeated_rows
        if torn.any() and self._frames_blank < _PATIENCE:
            self._frames_blank += 1
            return _is_covered(torn, frame.shape[0], xywh)
        self._repeated_rows, self._frames_blank = repeated, 0
        return False


def _is_flat(frame: Image, xywh: XYWH | None) -> bool:
    """Whether the area around a box, or the whole frame, contains nothing but noise."""
    height, width = frame.shape[:2]
    left, top, right, bottom = 0, 0, width, height
    if xywh is not None:
        x, y, w, h = xywh
        reach = _REACH * max(w, h)
        left, right = (int(min(max(edge, 0), width)) for edge in (x - reach, x + w + reach))
        top, bottom = (int(min(max(edge, 0), height)) for edge in (y - reach, y + h + reach))
        if right - left < _SAMPLES or bottom - top < _SAMPLES:
            return False  # too small a part of the area is in the frame
    step_x, step_y = (
        max((end - start) // (_SAMPLES * _PIXELS_PER_SAMPLE), 1)
        for start, end in ((left, right), (top, bottom))
    )
    area = _sampled(frame, slice(top, bottom, step_y), slice(left, right, step_x))
    samples = cv2.resize(area, (_SAMPLES, _SAMPLES), interpolation=cv2.INTER_AREA)
    # The range along y is also 0 where a decoder repeats a row.
    vertical_range = np.maximum.reduce(samples) - np.minimum.reduce(samples)
    return bool(vertical_range.max() <= _FLAT)


def _repeated_rows(frame: Image) -> NDArray[np.bool_]:
    """Whether each compared row equals the one below it over the full width; (n,) bool."""
    step_y, step_x = max(len(frame) // _ROWS, 1), max(frame.shape[1] // _COLUMNS, 1)
    last = len(frame) - _ROW_DISTANCE
    if last <= 0:
        return np.zeros(1, dtype=np.bool_)
    columns = slice(None, None, step_x)
    rows = _sampled(frame, slice(None, last, step_y), columns)
    below = _sampled(frame, slice(_ROW_DISTANCE, None, step_y), columns)
    difference = cv2.absdiff(rows, below).reshape(len(rows), -1)
    return np.asarray(difference.max(axis=1) <= _SAME_ROW)


def _sampled(frame: Image, rows: slice, columns: slice) -> Image:
    """Some rows and columns of a frame, contiguous; pixel by pixel if channels are in order."""
    if frame.strides[2] != 1:
        return np.ascontiguousarray(frame[rows, columns])
    pixels = np.ascontiguousarray(frame.view(_PIXEL)[rows, columns])
    return pixels.view(np.uint8)


def _is_covered(torn_rows: NDArray[np.bool_], height: int, xywh: XYWH) -> bool:
    """Whether too large a share of a box is covered by the torn rows (n,) of a frame."""
    row_y = (np.arange(len(torn_rows)) + 0.5) * height / len(torn_rows)
    in_box = (row_y >= xywh[1]) & (row_y <= xywh[1] + xywh[3])
    if not in_box.any():
        in_box[int(np.abs(row_y - xywh[1] - xywh[3] / 2).argmin())] = True
    return bool(torn_rows[in_box].mean() >= _COVERED)
