"""Losses against a NanoTrack v3 teacher, and its responses."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from helpers import toy_training as toy  # noqa: E402
from ssiam.networks.lite import LiteResponses  # noqa: E402
from ssiam.runtime import RuntimeOptions  # noqa: E402
from ssiam.training.distillation import lite_distillation_losses  # noqa: E402
from ssiam.training.settings import TeacherSettings  # noqa: E402
from ssiam.training.teachers import NanoTrackResponse, NanoTrackTeacher  # noqa: E402

EQUAL_WEIGHTS = TeacherSettings("", features=1.0, score=1.0, box=1.0)


def distances_to(corners):
    left, top, right, bottom = corners
    at = (torch.arange(32) - 15.5) * 8
    x, y = at[None].expand(32, 32), at[:, None].expand(32, 32)
    return torch.stack([x - left, y - top, right - x, bottom - y])[None]


def test_the_same_responses_as_the_teacher_have_no_loss():
    corners = (-30.0, -20.0, 40.0, 36.0)
    features = torch.randn(1, 96, 8, 8), torch.randn(1, 96, 16, 16)
    score = np.zeros((1, 15, 15), np.float32)
    score[:, 6:9, 6:9] = 1
    boxes = np.tile(np.float32(corners)[None, :, None, None], (1, 1, 15, 15))
    scaled = 3 * features[0].numpy(), 2 * features[1].numpy()
    teacher = NanoTrackResponse(*scaled, score, boxes)
    logits = torch.full((1, 1, 32, 32), -20.0)
    logits[..., 13:19, 13:19] = 20
    responses = LiteResponses(logits, logits, distances_to(corners), None)
    losses = lite_distillation_losses(teacher, responses, features, EQUAL_WEIGHTS)
    assert {name: float(loss) for name, loss in losses.items()} == pytest.approx(
        dict.fromkeys(losses, 0), abs=1e-4
    )


def test_the_teacher_detects_the_square(shared):
    batch = toy.batch(3, 2)
    teacher = NanoTrackTeacher(shared("data/weights/nanotrackv3"), RuntimeOptions())
    response = teacher(batch.template, batch.search)
    assert response.template.shape == (2, 96, 8, 8)
    assert response.search.shape == (2, 96, 16, 16)
    best = int(response.score[0].argmax())
    left, top, right, bottom = response.boxes[0].reshape(4, -1)[:, best].tolist()
    cx, cy, w, h = batch.box[0]
    assert ((left + right) / 2, (top + bottom) / 2) == pytest.approx((cx, cy), abs=8)
    assert (right - left, bottom - top) == pytest.approx((w, h), rel=0.25)
