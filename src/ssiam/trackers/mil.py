"""`RepeatableMil`: OpenCV's MIL, whose runs are alike.

MIL draws its features from the C library's `rand` and its samples from OpenCV's generator of the
thread that starts it, neither of which it seeds. What it learns in an update passes through
arrays that all MIL trackers of a process share (modules/video/src/tracking of OpenCV).
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock
from typing import Any, Final

import cv2

from ssiam.errors import ArgumentError
from ssiam.geometry import Image

_SEED: Final = 1  # any will do
_STATE: Final = 128  # bytes of glibc's generator, as it has by default
# MIL's features: so many parts along x and y, of at least 9 px^2 together, inside of the box.
_PARTS: Final = ((1, 2), (2, 1), (1, 4), (4, 1), (2, 2))
_SMALLEST_AREA: Final = 9

_ONE_AT_A_TIME = Lock()


class RepeatableMil:
    """`cv2.TrackerMIL` with the same random numbers in every run.

    Other users of OpenCV's generator are not disturbed. Nor are those of the C library's on Linux
    with glibc and on Windows; elsewhere its sequence begins anew. Whoever calls `rand` in another
    thread during `init` makes that run another one.

    Threads: one thread at a time for each object; calls on several objects wait for each other.
    """

    def __init__(self) -> None:
        self._tracker: Any = cv2.TrackerMIL.create()

    def init(self, image: Image, box: tuple[int, int, int, int]) -> None:
        """Start on a box (x, y, w, h) of whole pixels.

        Raises
        ------
        ArgumentError
            No feature fits into the box: OpenCV would look for one for ever.
        """
        _, _, w, h = box
        if not any(
            across * ((w - 1) // across) * down * ((h - 1) // down) >= _SMALLEST_AREA
            for across, down in _PARTS
        ):
            raise ArgumentError(
                f"mil cannot follow a box of {w}x{h} pixels: draw it larger, or take another "
                "tracker"
            )
        # OpenCV's generator is one for each thread: that of a new one is nobody else's.
        with _ONE_AT_A_TIME, ThreadPoolExecutor(1) as thread:
            thread.submit(self._start, image, box).result()

    def update(self, image: Image) -> tuple[bool, tuple[int, int, int, int]]:
        """Whether the target is found, and its box."""
        with _ONE_AT_A_TIME:
            found, box = self._tracker.update(image)
        return found, box

    def _start(self, image: Image, box: tuple[int, int, int, int]) -> None:
        cv2.setRNGSeed(_SEED)
        with _seeded_rand():
            self._tracker.init(image, box)


@contextmanager
def _seeded_rand() -> Iterator[None]:
    """The C library's `rand` seeded, and as it was afterwards where that can be."""
    if sys.platform == "win32":  # seeded alike in every new thread
        yield
        return
    library = ctypes.CDLL(None)
    if not hasattr(library, "gnu_get_libc_version"):
        library.srand(_SEED)
        yield
        return
    library.initstate.argtypes = (ctypes.c_uint, ctypes.c_void_p, ctypes.c_size_t)
    library.initstate.restype = library.setstate.restype = ctypes.c_void_p
    library.setstate.argtypes = (ctypes.c_void_p,)
    state = ctypes.create_string_buffer(_STATE)
    before = library.initstate(_SEED, state, _STATE)
    try:
        yield
    finally:
        library.setstate(before)
