"""Labels of the cells, the losses, and the learning rate schedule."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from ssiam.networks.lite import LiteResponses  # noqa: E402
from ssiam.training.data.batches import TeacherResponses  # noqa: E402
from ssiam.training.losses import (  # noqa: E402
    PairLabels,
    cell_labels,
    decode_boxes,
    distillation_losses,
    iou_and_giou,
    lite_losses,
    predictions_of,
    to_corners,
)
from ssiam.training.optimizer import learning_rate_factor  # noqa: E402
from ssiam.training.settings import (  # noqa: E402
    LossSettings,
    OptimizerSettings,
    TeacherSettings,
)

BOX = torch.tensor([[20.0, -12.0, 64.0, 48.0]])
PRESENT = torch.tensor([True])


def distances_to(corners):
    """Distances (1, 4, 15, 15) of all cells to the sides of a box."""
    left, top, right, bottom = corners
    at = (torch.arange(15) - 7) * 16.0
    x, y = at[None].expand(15, 15), at[:, None].expand(15, 15)
    return torch.stack([x - left, y - top, right - x, bottom - y])[None]


def perfect(box, confident=12.0):
    """Predictions of exactly this box."""
    cells = cell_labels(box, PRESENT)
    score = torch.where(cells.positive, confident, -confident)[:, None]
    quality = torch.full((1, 1, 15, 15), confident)
    return predictions_of(LiteResponses(score, quality, distances_to(to_corners(box)[0])))


def labels(box=BOX, present=PRESENT):
    return PairLabels(box, present, torch.ones(1))


@pytest.mark.parametrize("score", ["focal", "balanced"])
@pytest.mark.parametrize("box", ["giou", "log_iou"])
def test_exact_responses_have_no_loss(score, box):
    settings = LossSettings(score, box, distractor=1.0)
    losses = lite_losses(perfect(BOX), labels(), settings)
    assert {name: float(loss) for name, loss in losses.items()} == pytest.approx(
        {"score": 0, "box": 0, "quality": 0, "distractor": 0}, abs=1e-3
    )


@pytest.mark.parametrize(("margin", "loss"), [(3.0, 0.0), (24.0, 0.0), (26.0, 2.0)])
def test_a_distractor_has_to_score_less_by_a_margin(margin, loss):
    """The cells on the target score 12, the others -12."""
    settings = LossSettings(distractor=1.0, margin=margin)
    assert float(lite_losses(perfect(BOX), labels(), settings)["distractor"]) == loss


def test_the_same_responses_as_the_teacher_have_no_loss():
    corners = (-30.0, -20.0, 40.0, 36.0)
    score = np.zeros((1, 15, 15), np.float32)
    score[:, 6:9, 6:9] = 1
    boxes = np.tile(np.float32(corners)[None, :, None, None], (1, 1, 15, 15))
    logits = torch.from_numpy(score * 40 - 20)[:, None]
    responses = predictions_of(LiteResponses(logits, logits, distances_to(corners)))
    settings = TeacherSettings("", score=1.0, box=1.0)
    for weight in (1, 0):
        teacher = TeacherResponses(score, boxes, np.full(1, weight, np.float32))
        losses = distillation_losses(teacher, responses, settings)
        assert {name: float(loss) for name, loss in losses.items()} == pytest.approx(
            {"teacher_score": 0, "teacher_box": 0}, abs=1e-4
        )
        shifted = responses._replace(score=-responses.score, boxes=responses.boxes + 9)
        losses = distillation_losses(teacher, shifted, settings)
        assert all((float(loss) > 0.1) == (weight == 1) for loss in losses.values())


def test_the_box_loss_grows_with_the_distance():
    values = []
    for shift in (0, 8, 30, 200):
        predictions = perfect(BOX + torch.tensor([[shift, 0.0, 0.0, 0.0]]))
        losses = lite_losses(predictions, labels(), LossSettings())
        values.append(float(losses["box"]))
    assert values == sorted(values)
    assert values[-1] > 2


def test_pairs_of_weight_0_have_no_loss():
    unweighted = labels()._replace(weight=torch.zeros(1))
    losses = lite_losses(perfect(BOX + 30), unweighted, LossSettings())
    assert sum(map(float, losses.values())) == 0


@pytest.mark.parametrize(
    ("box", "present", "count"),
    [
        pytest.param((4.0, 4.0, 128.0, 128.0), True, 12, id="several cells"),
        pytest.param((4.0, 4.0, 2.0, 2.0), True, 1, id="smaller than a cell"),
        pytest.param((116.0, 0.0, 4.0, 4.0), True, 1, id="at the edge"),
        pytest.param((300.0, 0.0, 40.0, 40.0), True, 0, id="outside"),
        pytest.param((4.0, 4.0, 128.0, 128.0), False, 0, id="not present"),
    ],
)
def test_positive_cells(box, present, count):
    cells = cell_labels(torch.tensor([box]), torch.tensor([present]))
    assert int(cells.positive.sum()) == pytest.approx(count, abs=4 if count > 1 else 0)
    assert not (cells.positive & cells.ignored).any()
    assert bool(cells.ignored.any()) == (present and box[2] > 16 and box[0] < 200)


def test_positions_of_the_cells():
    boxes = decode_boxes(torch.zeros(1, 4, 15, 15))
    assert boxes[0, :, 0, 14].tolist() == [112, -112, 112, -112]
    positive = cell_labels(torch.tensor([[112.0, -112.0, 8.0, 8.0]]), PRESENT).positive
    assert positive.nonzero().tolist() == [[0, 0, 14]]


def test_iou_and_giou():
    boxes = torch.tensor([[0.0, 0, 4, 4], [0, 0, 4, 4], [0, 0, 1, 1]])
    others = torch.tensor([[0.0, 0, 4, 4], [2, 0, 6, 4], [2, 0, 3, 1]])
    iou, giou = iou_and_giou(boxes, others)
    assert iou.tolist() == pytest.approx([1, 1 / 3, 0])
    assert giou.tolist() == pytest.approx([1, 1 / 3, -1 / 3])


def test_the_learning_rate_rises_and_falls():
    settings = OptimizerSettings(warm_up=10, final=0.1)
    factors = [learning_rate_factor(step, 100, settings) for step in range(100)]
    assert max(factors) == factors[10] == 1
    assert factors[:10] == sorted(factors[:10])
    assert factors[10:] == sorted(factors[10:], reverse=True)
    assert factors[-1] == pytest.approx(0.1, abs=0.01)


def test_the_warm_up_is_at_most_a_tenth_of_the_steps():
    settings = OptimizerSettings(warm_up=10)
    factors = [learning_rate_factor(step, 20, settings) for step in range(3)]
    assert factors == [0.5, 1, 1]
