"""Examples of the paper's figures with given overlaps."""

import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.evaluation.paper.qualitative import Example


def example(off, stabilized, name="s", images=()):
    """A target of 20 x 20 px, and boxes with these overlaps; they are NaN where it is 0."""
    truth = np.tile([10.0, 10, 20, 20], (len(off), 1))
    boxes = []
    for overlaps in (off, stabilized):
        each = truth.copy()
        each[:, 2] *= overlaps  # a narrower box with exactly this overlap
        each[np.asarray(overlaps) == 0] = np.nan
        boxes.append(each)
    return Example("kcf", VideoSequence(name, images, truth), False, truth, *boxes)
