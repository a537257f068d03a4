"""Frames out of a camera of this machine, through OpenCV."""

from __future__ import annotations

import sys
import time
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from ssiam.errors import SourceError, StreamError
from ssiam.video.frames import Pictures, Source

_DEFAULT_FPS = Fraction(30)


def open_camera(index: int) -> Source:
    """`Source` of camera `index`, from 0; times are those of arrival.

    OpenCV and not PyAV, because it opens cameras by number on every system.
    """
    name = f"camera {index}"
    if index < 0 or (sys.platform == "linux" and not Path(f"/dev/video{index}").exists()):
        raise SourceError(f"{name}: there is no such camera ({_cameras_here()})")
    capture = cv2.VideoCapture(index)
    if not capture.isOpened():
        raise SourceError(
            f"{name}: cannot be opened; is it plugged in, free, and allowed for this user?"
        )
    # Drivers queue frames; a tracker that is late wants the newest.
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    return open_capture(name, capture)


def open_capture(name: str, capture: cv2.VideoCapture) -> Source:
    """`Source` of an opened OpenCV capture that is meant to deliver without end."""
    rate = capture.get(cv2.CAP_PROP_FPS)
    fps = Fraction(rate).limit_denominator(1001) if 1 <= rate <= 1000 else _DEFAULT_FPS
    return Source(name, _pictures(name, capture), fps=fps, length=None)


def _pictures(name: str, capture: cv2.VideoCapture) -> Pictures:
    count = 0
    started = 0.0
    try:
        while True:
            delivered, image = capture.read()
            if not delivered:
                break
            now = time.monotonic()
            started = started if count else now
            yield now - started, np.asarray(image, dtype=np.uint8)
            count += 1
    finally:
        capture.release()
    if not count:
        raise SourceError(f"{name}: opens but delivers no picture; is another program using it?")
    raise StreamError(f"{name}: broke off after {count} frames; was it unplugged?")


def _cameras_here() -> str:
    found = sorted(path.name[5:] for path in Path("/dev").glob("video[0-9]*"))
    return f"cameras here: {', '.join(found)}" if found else "no camera is connected"
