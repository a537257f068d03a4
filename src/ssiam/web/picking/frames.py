"""`FrameReader`: any frame of a source on demand, decoded as `ssiam track` decodes it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Final

from ssiam.errors import SourceError, SsiamError
from ssiam.video import Frame, Source

_CACHE_BYTES: Final = 192 * 2**20  # of decoded frames that are kept


class FrameReader:
    """Frames of a source by their index. For one thread.

    Frames are counted as they are delivered, so that an index means the same here and in the run
    that follows, whatever the frame rate, and also for formats without an index or with damaged
    frames. That is why the source is read from front to back, and from its beginning again for a
    frame before those in the cache; seeking in the file would be faster, but its frames have no
    numbers.

    Parameters
    ----------
    open_frames : callable
        Opens the source at its first frame.
    cache_bytes : int
        Maximum size of the cache. It has the frames that were used last.

    Attributes
    ----------
    length : int or None
        Number of frames: announced by the source until its end has been reached, then counted.
    """

    def __init__(self, open_frames: Callable[[], Source], cache_bytes: int = _CACHE_BYTES) -> None:
        self._open = open_frames
        self._cache_bytes = cache_bytes
        self._cached: OrderedDict[int, Frame] = OrderedDict()
        self._source = open_frames()
        self._next_index = 0
        self._is_counted = False
        self.length = self._source.length
        self.name = self._source.name
        self.fps = float(self._source.fps)
        self.size_wh = self._source.size_wh

    def read(self, index: int, is_wanted: Callable[[Frame], bool]) -> Frame:
        """The frame with this index, or the last one if the source ends before it.

        Parameters
        ----------
        index : int
            From 0.
        is_wanted : callable
            Called with each frame that is decoded on the way. If it returns False, that frame is
            the result.

        Raises
        ------
        SsiamError
            The source cannot be opened again, or is empty now.
        """
        if self._is_counted and self.length is not None:
            index = min(index, self.length - 1)
        if index in self._cached:
            self._cached.move_to_end(index)
            return self._cached[index]
        if index < self._next_index:
            self._reopen()
        last: Frame | None = None
        while True:
            frame = self._decode()
            if frame is None:
                break
            last = frame
            if frame.index >= index or not is_wanted(frame):
                return frame
        return last or self.read(self._next_index - 1, is_wanted)

    def close(self) -> None:
        """Release the source."""
        self._source.close()
        self._cached.clear()

    def _reopen(self) -> None:
        source = self._open()
        self._source.close()
        self._source, self._next_index = source, 0

    def _decode(self) -> Frame | None:
        """The next frame; None at the end, also of a source that breaks off."""
        try:
            frame = next(self._source, None)
        except SsiamError:
            # The run that follows reports it, and ends there too.
            frame = None
        if frame is None:
            if self._next_index == 0:
                raise SourceError(f"{self.name}: has no frame any more; was it changed?")
            self.length, self._is_counted = self._next_index, True
            return None
        self._next_index = frame.index + 1
        self._keep(frame)
        return frame

    def _keep(self, frame: Frame) -> None:
        self._cached[frame.index] = frame
        self._cached.move_to_end(frame.index)
        # One frame is always kept, however large.
        while len(self._cached) > max(1, self._cache_bytes // frame.image.nbytes):
            self._cached.popitem(last=False)
