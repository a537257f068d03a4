"""Losses against values computed by hand."""

import math

import pytest

torch = pytest.importorskip("torch")

from ssiam.training.losses import (  # noqa: E402
    CellLabels,
    _score_loss,
    mask_losses,
)
from ssiam.training.settings import LossSettings  # noqa: E402

LOG2 = math.log(2)  # cross-entropy of a probability of one half


def score(kind, logits, positive, ignored=()):
    """The score loss of one pair whose response map has these cells in a row."""
    cells = range(len(logits))
    targets = CellLabels(
        torch.tensor([[[cell in positive for cell in cells]]]),
        torch.tensor([[[cell in ignored for cell in cells]]]),
    )
    maps = torch.tensor([[logits]], dtype=torch.float32)
    return float(_score_loss(maps, targets, torch.ones(1), LossSettings(kind_of_score=kind)))


def test_focal_loss_weighs_positive_cells_by_a_quarter():
    """Lin et al., ICCV 2017: alpha = .25 of positive cells, 1 - alpha of negative ones, gamma = 2.

    Of two cells with probability one half, and a third negative one with 3/4.
    """
    positive, negative = 0.25 * 0.5**2 * LOG2, 0.75 * 0.5**2 * LOG2
    high = 0.75 * 0.75**2 * math.log(4)
    assert score("focal", [0, 0], positive={0}) == pytest.approx(positive + negative)
    found = score("focal", [0, 0, math.log(3)], positive={0})
    assert found == pytest.approx(positive + negative + high)


def test_focal_loss_is_the_sum_by_positive_cell():
    one = score("focal", [0.0, 0.0], positive={0})
    assert score("focal", [0.0] * 4, positive={0, 1}) == pytest.approx(one)
    assert score("focal", [0.0, 0.0, 9.0], positive={0}, ignored={2}) == pytest.approx(one)


def test_balanced_loss_weighs_both_kinds_of_cells_alike():
    found = score("balanced", [0, math.log(3), math.log(3), math.log(3)], positive={0})
    assert found == pytest.approx((LOG2 + math.log(4)) / 2)


def dice(probability, mask):
    """1 - Dice of a mask of 2 x 2 cells."""
    logit = math.log(probability / (1 - probability))
    logits, masks = (torch.full((1, 2, 2), value) for value in (logit, mask))
    return float(mask_losses(logits, masks)["dice"])


def test_dice_has_squares_in_its_denominator():
    """Milletari et al., 3DV 2016; 1 is added to both parts."""
    assert dice(0.5, 1.0) == pytest.approx(1 - (4 + 1) / (1 + 4 + 1))
    assert dice(0.2, 0.6) == pytest.approx(1 - (0.96 + 1) / (0.16 + 1.44 + 1))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_shares_that_are_met_cost_no_dice(share):
    assert dice(share, share) == pytest.approx(0, abs=1e-6)
