"""Tracks of targets that are bright in a channel of their own, and pairs of them."""

from dataclasses import dataclass

import numpy as np

from helpers.sets_on_disk import BOX, mask_of
from ssiam.errors import SourceError
from ssiam.training import AugmentSettings, PairSampler, PairSettings, WindowSettings

PLAIN = AugmentSettings(grey=0, flip=0, colour=0, blur=0, shake=0, jpeg=0, cover=0)
STRAIGHT = WindowSettings(angle=0, stretch=0)


@dataclass
class Track:
    """Frames in which nothing but the target is bright in its own channel."""

    name: str = "one"
    channel: int = 0
    frames: int = 1
    at: tuple = BOX
    others: tuple = ()
    hidden: tuple = ()
    broken: bool = False

    @property
    def shows(self):
        return (self.name,)

    def image(self, t):
        if self.broken:
            raise SourceError(f"{self.name}.jpg: is not an image")
        image = np.full((240, 320, 3), 20, np.uint8)
        for channel, (x, y, w, h) in [(self.channel, self.at), *self.others]:
            if channel != self.channel or t not in self.hidden:
                image[y : y + h, x : x + w, channel] = 250
        return image

    def box(self, t):
        return None if t in self.hidden else self.at

    def mask(self, t):
        return mask_of(self.at) > 0


def sampler(*sources, seed=0, **settings):
    settings = {"augment": PLAIN, "windows": STRAIGHT, "surroundings": 0, **settings}
    return PairSampler(sources, PairSettings(**settings), seed)


def box_of(plane):
    rows, columns = np.nonzero(plane > 135)
    left, right, top, bottom = columns.min(), columns.max(), rows.min(), rows.max()
    centre = (left + right) / 2 - 127, (top + bottom) / 2 - 127
    return np.array([*centre, right - left + 1, bottom - top + 1])
