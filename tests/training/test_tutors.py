"""Lessons of two trackers: which one is right, and where its maps lie on our cells."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from helpers import toy_training as toy  # noqa: E402
from ssiam.training.settings import TeacherSettings  # noqa: E402
from ssiam.training.tutors import Tutors, _on_our_cells, _Seen  # noqa: E402


class Says:
    """A network that puts a box of a score on every cell."""

    def __init__(self, box, score):
        self.box, self.score = np.array(box, np.float32), score

    def seen(self, *crops):
        boxes = np.broadcast_to(self.box[:, None, None], (4, 15, 15)).copy()
        return _Seen(np.full((15, 15), self.score, np.float32), boxes)


def tutors(nano, fear):
    made = object.__new__(Tutors)
    made._agreement, made._fear = 0.6, fear
    made._nano_seen = nano.seen
    return made


def pairs(**changes):
    batch = toy.batch(3, 2)  # the second pair does not show the target
    wh = np.full((2, 2), toy.SQUARE, np.float32)
    return replace(batch, template_wh=wh, **changes)


def corners(batch, off=0.0):
    cx, cy, w, h = batch.box[0]
    return cx - w / 2 + off, cy - h / 2, cx + w / 2 + off, cy + h / 2


@pytest.mark.parametrize(
    ("off_nano", "off_fear", "right"),
    [
        pytest.param(0, 10, "nano", id="the first"),
        pytest.param(10, 0, "fear", id="the second"),
        pytest.param(200, 200, None, id="none"),
    ],
)
def test_the_tutor_that_agrees_with_the_truth_teaches(off_nano, off_fear, right):
    batch = pairs()
    nano, fear = Says(corners(batch, off_nano), 0.25), Says(corners(batch, off_fear), 0.75)
    lessons = tutors(nano, fear).lessons(batch)
    assert lessons.weight.tolist() == [float(right is not None), 0]
    assert lessons.score[0, 0, 0] == {"nano": 0.25, "fear": 0.75, None: 0}[right]
    assert not lessons.score[1].any()


def test_maps_of_stretched_crops_lie_on_our_cells():
    """A peak of FEAR-XS at 64 px to the right of the middle of its crop, 32 px up."""
    logits = np.full((16, 16), -20, np.float32)
    logits[6, 12] = 20
    distances = np.full((4, 16, 16), 16, np.float32)
    seen = _on_our_cells(logits, distances, np.array([0.5, 2.0], np.float32))
    row, column = np.unravel_index(int(seen.score.argmax()), (15, 15))
    assert ((column - 7) * 16, (row - 7) * 16) == (32, -64)
    np.testing.assert_allclose(seen.boxes[:, row, column], [24, -96, 40, -32])


def test_both_see_the_square(shared):
    weights = str(shared("data/weights/nanotrackv3"))
    made = Tutors(TeacherSettings(weights, fear=str(shared("data/weights/fear_xs"))))
    batch = pairs()
    for seen in made._seen(batch, 0):
        best = np.unravel_index(int(seen.score.argmax()), (15, 15))
        box = seen.boxes[:, best[0], best[1]]
        np.testing.assert_allclose(box, corners(batch), atol=12)
    assert made.lessons(batch).weight.tolist() == [1, 0]
