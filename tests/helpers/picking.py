"""The picking page on a numbered clip, and its clients."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np

import ssiam
from helpers.live_server import SHORT_LIMITS, Live
from ssiam.errors import StreamError
from ssiam.video.frames import Source, SourceInfo
from ssiam.web.picking.page import PickPage

SIZE = (160, 120)
RATE = 10
FRAMES = 24


def numbered_image(number):
    """An image with a random texture and, in the corner pixel block, its number."""
    image = np.random.default_rng(1).integers(0, 255, (*SIZE[::-1], 3), dtype=np.uint8)
    image = np.roll(image, number, axis=1)
    image[:8, :8] = number
    return image


def number_of(image):
    """The number in an image."""
    return int(image[2:6, 2:6].mean().round())


class NumberedClip:
    """Opens a clip of numbered frames again and again; counts how often, and frames decoded."""

    def __init__(self, frames=FRAMES, announced=FRAMES, breaks=False):
        self.frames, self.announced, self.breaks = frames, announced, breaks
        self.opened = self.decoded = 0

    def __call__(self):
        self.opened += 1
        return Source("clip", self._images(), fps=RATE, length=self.announced, info=SourceInfo())

    def _images(self):
        for number in range(self.frames):
            self.decoded += 1
            # The times of a variable rate, which no index can be computed from.
            yield number / RATE + 0.013 * (number % 3), numbered_image(number)
        if self.breaks:
            raise StreamError("clip: broke off")


def square_around(image, point_xy):
    """A proposal without networks."""
    x, y = point_xy
    return x - 10.0, y - 10.0, 20.0, 20.0


@contextmanager
def picking(open_frames=None, *, propose=square_around, grace=(0.5, 0.3), **options):
    """A page on a clip, by default a numbered one."""
    options = {"limits": SHORT_LIMITS, **options}
    tracker = ssiam.load_tracker("csrt", stabilize="predict")
    page = PickPage(
        open_frames or NumberedClip(), tracker, name="csrt", propose=propose, grace=grace, **options
    )
    with page:
        yield page


def as_live(page):
    """What clients of tests need of a server."""
    return Live(page._session, None, None, page._server)
