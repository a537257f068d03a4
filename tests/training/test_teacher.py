"""A lesson of NanoTrack v3, and how unlike it a response is."""

import pytest

torch = pytest.importorskip("torch")

from helpers import toy_training as toy  # noqa: E402
from ssiam.networks.lite import LiteResponses  # noqa: E402
from ssiam.training.settings import TeacherSettings  # noqa: E402
from ssiam.training.teacher import Lesson, Teacher, lesson_losses  # noqa: E402

ALL_ONE = TeacherSettings("", 1.0, 1.0, 1.0)


def distances_to(corners):
    left, top, right, bottom = corners
    at = (torch.arange(32) - 15.5) * 8
    x, y = at[None].expand(32, 32), at[:, None].expand(32, 32)
    return torch.stack([x - left, y - top, right - x, bottom - y])[None]


def test_saying_the_same_costs_nothing():
    corners = (-30.0, -20.0, 40.0, 36.0)
    features = torch.randn(1, 96, 8, 8), torch.randn(1, 96, 16, 16)
    score = torch.zeros(1, 15, 15)
    score[:, 6:9, 6:9] = 1
    boxes = torch.tensor(corners)[None, :, None, None].expand(1, 4, 15, 15)
    lesson = Lesson(3 * features[0], 2 * features[1], score, boxes)
    logits = torch.full((1, 1, 32, 32), -20.0)
    logits[..., 13:19, 13:19] = 20
    responses = LiteResponses(logits, logits, distances_to(corners), None)
    losses = lesson_losses(lesson, responses, features, ALL_ONE)
    assert {name: float(loss) for name, loss in losses.items()} == pytest.approx(
        dict.fromkeys(losses, 0), abs=1e-4
    )


def test_the_teacher_sees_the_square(shared):
    batch = toy.batch(3, 2)
    lesson = Teacher(shared("data/weights/nanotrackv3"), 1).lesson(batch.template, batch.search)
    assert lesson.template.shape == (2, 96, 8, 8)
    assert lesson.search.shape == (2, 96, 16, 16)
    best = int(lesson.score[0].argmax())
    left, top, right, bottom = lesson.boxes[0].flatten(1)[:, best].tolist()
    cx, cy, w, h = batch.box[0]
    assert ((left + right) / 2, (top + bottom) / 2) == pytest.approx((cx, cy), abs=8)
    assert (right - left, bottom - top) == pytest.approx((w, h), rel=0.25)
