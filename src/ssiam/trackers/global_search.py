"""`GlobalSearch`: where in the whole frame a lost target is searched for next.

In every frame one window is searched by the tracker itself, so that a sweep over the frame takes
many frames. Places that resemble the target come first: the frame is reduced until the target has
ten pixels, and compared with pictures of the target of that size.
"""

from __future__ import annotations

import math
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.copying import DeepCopied
from ssiam.geometry import XYWH, Image

_SIDE: Final = 10  # px, geometric mean of the sides of the target's picture
_MIN_SIDE, _MAX_SIDE = 5, 20  # px, of one side of it
_MAX_WIDTH: Final = 320  # px, of the reduced frame
_PICTURE_INTERVAL: Final = 10  # frames between two pictures of the target
_PROPOSALS: Final = 4  # places that are looked up in one frame
_MIN_CORRELATION: Final = 0.4  # of a place with a picture of the target
_STEP: Final = 1.6  # target sizes between two windows of a sweep
_SCALES: Final = (1.0, 1.5)  # of the windows, by sweep
_STRIDE: Final = 0.382  # share of a sweep between two successive windows, (3 - sqrt(5)) / 2


class GlobalSearch(DeepCopied):
    """The successive windows of the search for one target.

    Threads: one thread at a time for each object; several objects are independent.
    """

    def __init__(self) -> None:
        self._pictures: list[Image] = []  # the first and the last one
        self._size_wh = (_SIDE, _SIDE)  # of a picture
        self._age = _PICTURE_INTERVAL
        self._places: list[tuple[float, float]] = []  # proposed centers
        self._count = 0

    def observe(self, frame: Image, xywh: XYWH) -> None:
        """Take a picture of the target, at most one in ten frames."""
        self._age += 1
        if self._age < _PICTURE_INTERVAL:
            return
        x, y, w, h = xywh
        size = math.sqrt(w * h)
        if not self._pictures:
            sides = (round(side * _SIDE / size) for side in (w, h))
            width, height = (min(max(side, _MIN_SIDE), _MAX_SIDE) for side in sides)
            self._size_wh = width, height
        left, top, right, bottom = (round(edge) for edge in (x, y, x + w, y + h))
        part = frame[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
        if not part.size:
            return
        self._age = 0
        picture = cv2.resize(part, self._size_wh, interpolation=cv2.INTER_AREA)
        self._pictures = [*self._pictures[:1], np.asarray(picture, np.uint8)]

    def restart(self) -> None:
        """Begin a new search."""
        self._places, self._count = [], 0

    def window(self, frame: Image, size_wh: tuple[float, float]) -> XYWH:
        """The box around which a target of this size is searched next; raw-frame pixels."""
        self._count += 1
        if self._count % 4 == 1:
            self._places = self._proposed(frame, math.sqrt(size_wh[0] * size_wh[1]))
        w, h = size_wh
        if self._places and self._count % 4:
            x, y = self._places.pop(0)
        else:
            x, y, scale = self._swept(frame, math.sqrt(w * h))
            w, h = w * scale, h * scale
        return x - w / 2, y - h / 2, w, h

    def _swept(self, frame: Image, size: float) -> tuple[float, float, float]:
        """Center of the next window of a sweep over the frame, and its scale."""
        height, width = frame.shape[:2]
        grids = [
            [max(math.ceil(side / (_STEP * scale * size)), 1) for side in (width, height)]
            for scale in _SCALES
        ]
        counts = [columns * rows for columns, rows in grids]
        number = self._count % sum(counts)
        index = 0
        while number >= counts[index]:
            number -= counts[index]
            index += 1
        columns, rows = grids[index]
        row, column = divmod(_scattered(number, counts[index]), columns)
        x, y = (column + 0.5) * width / columns, (row + 0.5) * height / rows
        return x, y, _SCALES[index]

    def _proposed(self, frame: Image, size: float) -> list[tuple[float, float]]:
        """Centers of the places that are most like the pictures of the target."""
        if not self._pictures:
            return []
        height, width = frame.shape[:2]
        zoom = min(_SIDE / size, _MAX_WIDTH / max(width, height))
        small_wh = max(round(width * zoom), 1), max(round(height * zoom), 1)
        w, h = self._size_wh
        if small_wh[0] <= w or small_wh[1] <= h:
            return []
        small = cv2.resize(frame, small_wh, interpolation=cv2.INTER_AREA)
        maps = [cv2.matchTemplate(small, each, cv2.TM_CCOEFF_NORMED) for each in self._pictures]
        correlation = np.nan_to_num(np.max(maps, axis=0))
        return [
            ((x + w / 2) * width / small_wh[0], (y + h / 2) * height / small_wh[1])
            for x, y in _peaks(correlation, max(w, h) // 2)
        ]


def _peaks(correlation: NDArray[np.float32], reach: int) -> list[tuple[int, int]]:
    """Positions of the highest maxima, at least `reach` pixels apart."""
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    is_peak = (correlation >= cv2.dilate(correlation, kernel)) & (correlation > _MIN_CORRELATION)
    rows, columns = np.nonzero(is_peak)
    order = np.argsort(-correlation[rows, columns])[:_PROPOSALS]
    return [(int(columns[i]), int(rows[i])) for i in order]


def _scattered(number: int, count: int) -> int:
    """The place of a number in an order in which successive places are far from each other."""
    stride = max(round(_STRIDE * count), 1)
    while math.gcd(stride, count) != 1:
        stride += 1
    return number * stride % count
