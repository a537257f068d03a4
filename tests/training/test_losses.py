"""Targets of the cells, and losses against what they should be."""

import pytest

torch = pytest.importorskip("torch")

from ssiam.networks.lite import LiteResponses  # noqa: E402
from ssiam.training.losses import Truth, overlaps, pair_losses  # noqa: E402
from ssiam.training.schedule import rate  # noqa: E402
from ssiam.training.settings import LossSettings, OptimiserSettings  # noqa: E402
from ssiam.training.targets import cell_targets, corners_of, decoded  # noqa: E402

BOX = torch.tensor([[20.0, -12.0, 64.0, 48.0]])
PRESENT = torch.tensor([True])


def perfect(box, sure=12.0, mask=None):
    """Responses that say just where the box is; the mask's logits are 0 unless given."""
    targets = cell_targets(box, PRESENT)
    at = (torch.arange(32) - 15.5) * 8
    left, top, right, bottom = corners_of(box)[0]
    x, y = at[None].expand(32, 32), at[:, None].expand(32, 32)
    distances = torch.stack([x - left, y - top, right - x, bottom - y])[None]
    score = torch.where(targets.positive, sure, -sure)[:, None]
    mask = torch.zeros(1, 1, 64, 64) if mask is None else mask
    return LiteResponses(score, torch.full((1, 1, 32, 32), sure), distances, mask)


def truth(box=BOX, present=PRESENT):
    mask = torch.zeros(1, 64, 64)
    mask[:, 20:30, 30:44] = 1
    return Truth(box, present, mask * present, torch.tensor([True]), torch.ones(1))


@pytest.mark.parametrize("score", ["focal", "balanced"])
@pytest.mark.parametrize("box", ["giou", "log_iou"])
def test_the_truth_costs_nothing(score, box):
    mask = (truth().mask[:, None] * 2 - 1) * 20
    losses = pair_losses(perfect(BOX, mask=mask), truth(), LossSettings(score, box))
    assert {name: float(loss) for name, loss in losses.items()} == pytest.approx(
        {"score": 0, "box": 0, "quality": 0, "mask": 0}, abs=1e-3
    )


def test_a_box_beside_costs_more_the_farther_it_is():
    costs = []
    for shift in (0, 8, 30, 200):
        responses = perfect(BOX + torch.tensor([[shift, 0.0, 0.0, 0.0]]))
        losses = pair_losses(responses, truth(), LossSettings())
        costs.append(float(losses["box"]))
    assert costs == sorted(costs)
    assert costs[-1] > 2


def test_pairs_of_no_weight_count_for_nothing():
    nothing = truth()._replace(weight=torch.zeros(1))
    losses = pair_losses(perfect(BOX + 30), nothing, LossSettings())
    assert sum(map(float, losses.values())) == 0


@pytest.mark.parametrize(
    ("box", "present", "count"),
    [
        pytest.param((4.0, 4.0, 64.0, 64.0), True, 12, id="usual"),
        pytest.param((4.0, 4.0, 2.0, 2.0), True, 1, id="smaller than a cell"),
        pytest.param((120.0, 0.0, 4.0, 4.0), True, 1, id="at the edge"),
        pytest.param((300.0, 0.0, 40.0, 40.0), True, 0, id="outside"),
        pytest.param((4.0, 4.0, 64.0, 64.0), False, 0, id="not present"),
    ],
)
def test_positive_cells(box, present, count):
    targets = cell_targets(torch.tensor([box]), torch.tensor([present]))
    assert int(targets.positive.sum()) == pytest.approx(count, abs=4 if count > 1 else 0)
    assert not (targets.positive & targets.ignored).any()
    assert bool(targets.ignored.any()) == (present and box[2] > 8 and box[0] < 200)


def test_cells_lie_where_the_interface_says():
    boxes = decoded(torch.zeros(1, 4, 32, 32))
    assert boxes[0, :, 0, 31].tolist() == [124, -124, 124, -124]
    positive = cell_targets(torch.tensor([[124.0, -124.0, 8.0, 8.0]]), PRESENT).positive
    assert positive.nonzero().tolist() == [[0, 0, 31]]


def test_overlaps():
    boxes = torch.tensor([[0.0, 0, 4, 4], [0, 0, 4, 4], [0, 0, 1, 1]])
    others = torch.tensor([[0.0, 0, 4, 4], [2, 0, 6, 4], [2, 0, 3, 1]])
    iou, giou = overlaps(boxes, others)
    assert iou.tolist() == pytest.approx([1, 1 / 3, 0])
    assert giou.tolist() == pytest.approx([1, 1 / 3, -1 / 3])


def test_the_rate_rises_and_falls():
    settings = OptimiserSettings(warm_up=10, final=0.1)
    rates = [rate(step, 100, settings) for step in range(100)]
    assert max(rates) == rates[10] == 1
    assert rates[:10] == sorted(rates[:10])
    assert rates[10:] == sorted(rates[10:], reverse=True)
    assert rates[-1] == pytest.approx(0.1, abs=0.01)


def test_the_rise_of_a_short_phase_is_short():
    rates = [rate(step, 20, OptimiserSettings(warm_up=10)) for step in range(20)]
    assert rates[:3] == [0.5, 1, 1]
