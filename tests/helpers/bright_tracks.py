"""Tracks whose target is bright in one color channel, and samplers of pairs of them."""

from dataclasses import dataclass

import numpy as np

from helpers.sets_on_disk import BOX, mask_of
from ssiam.errors import SourceError
from ssiam.training import AugmentSettings, CropSettings, PairSampler, PairSettings

NO_AUGMENTATION = AugmentSettings(grey=0, flip=0, colour=0, blur=0, shake=0, jpeg=0, cover=0)
UPRIGHT = CropSettings(angle=0, stretch=0)


@dataclass
class BrightTrack:
    """Frames in which only the target is bright in its channel."""

    name: str = "one"
    channel: int = 0
    frames: int = 1
    xywh: tuple = BOX
    others: tuple = ()  # channel and box of distractors
    hidden: tuple = ()
    damaged: bool = False

    @property
    def scene_ids(self):
        return (self.name,)

    def image(self, t):
        if self.damaged:
            raise SourceError(f"{self.name}.jpg: is not an image")
        image = np.full((240, 320, 3), 20, np.uint8)
        for channel, (x, y, w, h) in [(self.channel, self.xywh), *self.others]:
            if channel != self.channel or t not in self.hidden:
                image[y : y + h, x : x + w, channel] = 250
        return image

    def box(self, t):
        return None if t in self.hidden else self.xywh

    def mask(self, t):
        return mask_of(self.xywh) > 0


class TrackWithoutMask(BrightTrack):
    def mask(self, t):
        return None


def pair_sampler(*sources, seed=0, **settings):
    """A sampler without augmentation and rotation unless `settings` say otherwise."""
    defaults = {"augment": NO_AUGMENTATION, "windows": UPRIGHT, "surroundings": 0}
    return PairSampler(sources, PairSettings(**{**defaults, **settings}), seed)


def bright_box(channel):
    """cx, cy, w, h of the bright pixels of a channel, px from the middle of the search crop."""
    rows, columns = np.nonzero(channel > 135)
    left, right, top, bottom = columns.min(), columns.max(), rows.min(), rows.max()
    center = (left + right) / 2 - 127, (top + bottom) / 2 - 127
    return np.array([*center, right - left + 1, bottom - top + 1])
