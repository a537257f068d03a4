"""Trackers that fail on demand."""

from __future__ import annotations

import threading

from ssiam.stabilize import StabilizerConfig
from ssiam.trackers import StabilizedTracker
from ssiam.trackers.opencv import OpenCvTracker


class FailingTracker:
    """KCF that calls `failure` with the number of the frame, from 1, before it tracks."""

    def __init__(self, failure):
        self._failure, self._inner, self._frames = failure, OpenCvTracker("kcf"), 0

    @property
    def can_seek(self):
        return self._inner.can_seek

    @property
    def reseek_below(self):
        return self._inner.reseek_below

    def init(self, view, xywh):
        self._inner.init(view, xywh)

    def update(self, view):
        self._frames += 1
        self._failure(self._frames)
        return self._inner.update(view)

    def seek(self, view, xywh):
        return self._inner.seek(view, xywh)

    def clone(self):
        return FailingTracker(self._failure)


def every_tenth(frame):
    if frame % 10 == 0:
        raise RuntimeError("this network has come apart\nin two lines")


def leave(frame):
    if frame > 3:
        raise SystemExit("out of the thread")


class Hang:
    """A failure that blocks until `let_go` is set, like a C++ tracker that never returns."""

    def __init__(self):
        self.hangs, self.let_go = threading.Event(), threading.Event()

    def __call__(self, frame):
        if frame > 3 and not self.let_go.is_set():
            self.hangs.set()
            self.let_go.wait()


def failing_tracker(failure, stabilize="predict"):
    return StabilizedTracker(FailingTracker(failure), StabilizerConfig(stabilize))
