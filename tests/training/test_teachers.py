"""Two teachers: which one is right about a pair, and FEAR-XS's maps on the cells of "lite"."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from helpers import toy_training as toy  # noqa: E402
from ssiam.training.settings import TeacherSettings  # noqa: E402
from ssiam.training.teachers import Teachers, _resampled, _Response  # noqa: E402


def pairs(**changes):
    batch = toy.batch(3, 2)  # the second pair is negative
    wh = np.full((2, 2), toy.SQUARE, np.float32)
    return replace(batch, template_wh=wh, **changes)


def corners(batch, shift=0.0):
    cx, cy, w, h = batch.box[0]
    return cx - w / 2 + shift, cy - h / 2, cx + w / 2 + shift, cy + h / 2


def constant_response(box, score):
    boxes = np.broadcast_to(np.float32(box)[:, None, None], (4, 15, 15)).copy()
    return _Response(np.full((15, 15), score, np.float32), boxes)


class ConstantTeachers(Teachers):
    """Teachers with the same response to every pair."""

    def __init__(self, *responses):
        self._min_overlap = 0.6
        self._responses = list(responses)

    def _respond(self, batch, index):
        return self._responses


@pytest.mark.parametrize(
    ("nanotrack_shift", "fear_shift", "right"),
    [
        pytest.param(0, 10, "nanotrack", id="the first"),
        pytest.param(10, 0, "fear", id="the second"),
        pytest.param(200, 200, None, id="none"),
    ],
)
def test_the_teacher_with_the_larger_overlap_is_used(nanotrack_shift, fear_shift, right):
    batch = pairs()
    nanotrack = constant_response(corners(batch, nanotrack_shift), 0.25)
    fear = constant_response(corners(batch, fear_shift), 0.75)
    responses = ConstantTeachers(nanotrack, fear).responses(batch)
    assert responses.weight.tolist() == [float(right is not None), 0]
    assert responses.score[0, 0, 0] == {"nanotrack": 0.25, "fear": 0.75, None: 0}[right]
    assert not responses.score[1].any()


def test_maps_of_stretched_crops_are_resampled():
    """A maximum of FEAR-XS at 64 px to the right of the middle of its crop, 32 px up."""
    logits = np.full((16, 16), -20, np.float32)
    logits[6, 12] = 20
    distances = np.full((4, 16, 16), 16, np.float32)
    response = _resampled(logits, distances, np.array([0.5, 2.0], np.float32))
    row, column = np.unravel_index(int(response.score.argmax()), (15, 15))
    assert ((column - 7) * 16, (row - 7) * 16) == (32, -64)
    np.testing.assert_allclose(response.boxes[:, row, column], [24, -96, 40, -32])


def test_both_teachers_detect_the_square(shared):
    weights = str(shared("data/weights/nanotrackv3"))
    teachers = Teachers(TeacherSettings(weights, fear=str(shared("data/weights/fear_xs"))))
    batch = pairs()
    for response in teachers._respond(batch, 0):
        best = np.unravel_index(int(response.score.argmax()), (15, 15))
        box = response.boxes[:, best[0], best[1]]
        np.testing.assert_allclose(box, corners(batch), atol=12)
    assert teachers.responses(batch).weight.tolist() == [1, 0]
