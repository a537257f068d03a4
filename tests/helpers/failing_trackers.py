"""Trackers that fail in ways that cannot be brought about on purpose in real ones."""

from __future__ import annotations

import threading

from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import SteadiedTracker
from ssiam.trackers.opencv import OpenCvTracker


class Troubled:
    """KCF, in front of which `trouble` is called with the number of the frame, from 1."""

    def __init__(self, trouble):
        self._trouble, self._inner, self._frames = trouble, OpenCvTracker("kcf"), 0

    @property
    def doubt(self):
        return self._inner.doubt

    def init(self, view, xywh):
        self._inner.init(view, xywh)

    def track(self, view):
        self._frames += 1
        self._trouble(self._frames)
        return self._inner.track(view)

    def seek(self, view, xywh):
        return self._inner.seek(view, xywh)

    def another(self):
        return Troubled(self._trouble)


def every_tenth(frame):
    if frame % 10 == 0:
        raise RuntimeError("this network has come apart\nin two lines")


def leave(frame):
    if frame > 3:
        raise SystemExit("out of the thread")


class Hang:
    """A frame that does not end until it is let go; as a tracker in C++ that never returns."""

    def __init__(self):
        self.hangs, self.let_go = threading.Event(), threading.Event()

    def __call__(self, frame):
        if frame > 3 and not self.let_go.is_set():
            self.hangs.set()
            self.let_go.wait()


def troubled_tracker(trouble, stabilize="predict"):
    return SteadiedTracker(Troubled(trouble), StabilizerConfig(stabilize))
