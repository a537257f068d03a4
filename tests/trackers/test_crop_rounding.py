"""Search crops have whole-pixel corners; boxes are computed from the actual corner."""

import numpy as np
import pytest

from helpers.stub_networks import MARKER, Stub, marked
from ssiam import FrameView
from ssiam.trackers.lite import LiteNetworks, LiteTracker

SIDE = 63.5  # px; with this side the search crop has the network's input size
CENTER = (200.0, 150.0)


def marker_search():
    """A search network whose cells all return the marker's box, in whole pixels of the crop."""

    def answer(t, crop, *kernels):
        rows, columns = np.nonzero(marked(crop[0]))
        middle = crop.shape[-1] / 2
        left, right = columns.min() - middle, columns.max() + 1 - middle
        top, bottom = rows.min() - middle, rows.max() + 1 - middle
        offsets = (np.arange(15) - 7) * 16
        y, x = np.meshgrid(offsets, offsets, indexing="ij")
        distances = np.stack([x - left, y - top, right - x, bottom - y])[None]
        logits = np.full((1, 1, 15, 15), 8, np.float32)
        return [logits, logits, distances.astype(np.float32)]

    return Stub(answer)


def frame():
    """A frame with a square of 64 pixels around `CENTER`."""
    image = np.full((300, 400, 3), 90, np.uint8)
    image[118:182, 168:232] = MARKER
    return image


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.3, -0.4), (-0.7, 0.8), (5.45, -3.55)])
def test_the_center_does_not_depend_on_the_rounding_of_the_crop(offset):
    context = np.zeros((1, 1), np.float32)
    tracker = LiteTracker(LiteNetworks(Stub(lambda t, crop: [crop, context]), marker_search()))
    x, y = (center + d - SIDE / 2 for center, d in zip(CENTER, offset, strict=True))
    view = FrameView(frame())
    tracker.init(view, (x, y, SIDE, SIDE))
    x, y, w, h = tracker.update(view).box
    assert (x + w / 2, y + h / 2) == pytest.approx(CENTER, abs=1e-3)
