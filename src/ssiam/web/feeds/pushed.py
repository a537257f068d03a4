"""`PushedFeed`: pictures that somebody sends, as a browser with a camera does."""

from __future__ import annotations

import time
from collections import deque

from ssiam.geometry import Image, check_frame
from ssiam.video import Frame
from ssiam.web.feeds.newest import Newest

# Pictures over which the rate is measured.
_RATE_PICTURES = 30


class PushedFeed(Newest):
    """The newest of the pictures that are pushed, whatever their size.

    Its size and rate are unknown (None) until pictures have come; times are those of arrival.
    """

    def __init__(self, name: str = "browser") -> None:
        super().__init__(name)
        self._count = 0
        self._first = 0.0
        self._came: deque[float] = deque(maxlen=_RATE_PICTURES)

    def push(self, image: Image) -> None:
        """Bring a (H, W, 3) uint8 BGR picture; `ArgumentError` if it is none."""
        size_wh = check_frame(image)
        with self._changed:
            if self._closed:
                return
            now = time.monotonic()
            self._first = now if not self._count else self._first
            self._came.append(now)
            self.size_wh, self.fps = size_wh, self._rate()
            self._put(Frame(self._count, now - self._first, image))
            self._count += 1

    def _rate(self) -> float | None:
        """Pictures a second, of late."""
        seconds = self._came[-1] - self._came[0]
        return (len(self._came) - 1) / seconds if seconds > 0 else None
