"""Labels of the cells, the losses, and the learning rate schedule."""

import pytest

torch = pytest.importorskip("torch")

from ssiam.networks.lite import LiteResponses  # noqa: E402
from ssiam.training.losses import (  # noqa: E402
    PairLabels,
    cell_labels,
    decode_boxes,
    iou_and_giou,
    lite_losses,
    to_corners,
)
from ssiam.training.optimizer import learning_rate_factor  # noqa: E402
from ssiam.training.settings import LossSettings, OptimizerSettings  # noqa: E402

BOX = torch.tensor([[20.0, -12.0, 64.0, 48.0]])
PRESENT = torch.tensor([True])


def perfect(box, confident=12.0, mask=None):
    """Responses that predict the box exactly; the mask's logits are 0 unless given."""
    cells = cell_labels(box, PRESENT)
    at = (torch.arange(32) - 15.5) * 8
    left, top, right, bottom = to_corners(box)[0]
    x, y = at[None].expand(32, 32), at[:, None].expand(32, 32)
    distances = torch.stack([x - left, y - top, right - x, bottom - y])[None]
    score = torch.where(cells.positive, confident, -confident)[:, None]
    mask = torch.zeros(1, 1, 64, 64) if mask is None else mask
    return LiteResponses(score, torch.full((1, 1, 32, 32), confident), distances, mask)


def labels(box=BOX, present=PRESENT):
    mask = torch.zeros(1, 64, 64)
    mask[:, 20:30, 30:44] = 1
    return PairLabels(box, present, mask * present, torch.tensor([True]), torch.ones(1))


@pytest.mark.parametrize("score", ["focal", "balanced"])
@pytest.mark.parametrize("box", ["giou", "log_iou"])
def test_exact_responses_have_no_loss(score, box):
    mask = (labels().mask[:, None] * 2 - 1) * 20
    losses = lite_losses(perfect(BOX, mask=mask), labels(), LossSettings(score, box))
    assert {name: float(loss) for name, loss in losses.items()} == pytest.approx(
        {"score": 0, "box": 0, "quality": 0, "mask": 0}, abs=1e-3
    )


def test_the_box_loss_grows_with_the_distance():
    values = []
    for shift in (0, 8, 30, 200):
        responses = perfect(BOX + torch.tensor([[shift, 0.0, 0.0, 0.0]]))
        losses = lite_losses(responses, labels(), LossSettings())
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
        pytest.param((4.0, 4.0, 64.0, 64.0), True, 12, id="several cells"),
        pytest.param((4.0, 4.0, 2.0, 2.0), True, 1, id="smaller than a cell"),
        pytest.param((120.0, 0.0, 4.0, 4.0), True, 1, id="at the edge"),
        pytest.param((300.0, 0.0, 40.0, 40.0), True, 0, id="outside"),
        pytest.param((4.0, 4.0, 64.0, 64.0), False, 0, id="not present"),
    ],
)
def test_positive_cells(box, present, count):
    cells = cell_labels(torch.tensor([box]), torch.tensor([present]))
    assert int(cells.positive.sum()) == pytest.approx(count, abs=4 if count > 1 else 0)
    assert not (cells.positive & cells.ignored).any()
    assert bool(cells.ignored.any()) == (present and box[2] > 8 and box[0] < 200)


def test_positions_of_the_cells():
    boxes = decode_boxes(torch.zeros(1, 4, 32, 32))
    assert boxes[0, :, 0, 31].tolist() == [124, -124, 124, -124]
    positive = cell_labels(torch.tensor([[124.0, -124.0, 8.0, 8.0]]), PRESENT).positive
    assert positive.nonzero().tolist() == [[0, 0, 31]]


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
