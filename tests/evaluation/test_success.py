"""Success, precision, AO and SR: known cases, missing boxes, missing ground truth."""

import numpy as np
import pytest

from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.success import (
    THRESHOLDS,
    average_overlap,
    got10k_overlaps,
    mean_success,
    success,
)

NAN = np.nan
TRUTH = np.tile([100.0, 80.0, 40.0, 20.0], (10, 1))


def shifted(dx, dy=0.0):
    return TRUTH + np.array([dx, dy, 0, 0])


def test_the_ground_truth():
    found = success(TRUTH, TRUTH)
    # No overlap is above 1, so 20 of 21 thresholds are passed.
    assert found.auc == pytest.approx(20 / 21)
    assert (found.precision, found.normalized_precision) == (1, 1)
    assert len(THRESHOLDS) == len(found.curve) == 21


CASES = [
    # name, boxes, overlap, precision at 20 px, at .2 of the size
    ("8 px away", shifted(8), 32 / 48, 1, 1),
    ("9 px away", shifted(9), 31 / 49, 1, 0),
    ("20 px away", shifted(20), 20 / 60, 1, 0),
    ("21 px away", shifted(21), 19 / 61, 0, 0),
    ("lost", shifted(500), 0, 0, 0),
    ("unknown", np.full((10, 4), NAN), -1, 0, 0),
    ("no area", TRUTH * (1, 1, 0, 0), 0, 0, 0),
]


@pytest.mark.parametrize(
    ("boxes", "overlap", "precision", "normalized"),
    [pytest.param(*case[1:], id=case[0]) for case in CASES],
)
def test_measures_of_a_constant_offset(boxes, overlap, precision, normalized):
    found = success(boxes, TRUTH)
    np.testing.assert_array_equal(found.curve, (overlap > THRESHOLDS).astype(float))
    assert found.normalized_precision == normalized
    if not np.array_equal(boxes[:, 2:], TRUTH[:, 2:] * 0):
        assert found.precision == precision


def test_missing_ground_truth_does_not_count_and_missing_boxes_do():
    truth, boxes = TRUTH.copy(), TRUTH.copy()
    truth[:2], truth[2, 2:] = NAN, 0
    boxes[6:] = NAN
    found = success(boxes, truth)
    assert found.precision == pytest.approx(3 / 7)
    assert found.auc == pytest.approx(20 / 21 * 3 / 7)


def test_the_mean_weights_sequences_equally_without_empty_ones():
    empty = success(TRUTH, np.full((10, 4), NAN))
    assert np.isnan(empty.auc)
    found = mean_success([success(TRUTH, TRUTH), success(shifted(500)[:2], TRUTH[:2]), empty])
    assert found.precision == 0.5
    assert found.auc == pytest.approx(10 / 21)
    assert np.isnan(mean_success([empty]).precision)
    assert np.isnan(mean_success([]).auc)


@pytest.mark.parametrize("boxes", [TRUTH[:5], np.zeros((10, 8)), np.zeros(4)])
def test_wrong_shapes_are_refused(boxes):
    with pytest.raises(ArgumentError, match="both must be"):
        success(boxes, TRUTH)


def test_got10k_leaves_out_the_first_frame_and_hidden_ones():
    boxes = shifted(500)
    boxes[1:5] = TRUTH[1:5]
    covered = np.array([8, 8, 8, 0, 0, 0, 8, 8, 8, 8])
    overlaps = got10k_overlaps(boxes, TRUTH, (640, 480), covered)
    assert overlaps.tolist() == [1, 1, 0, 0, 0, 0]
    assert len(got10k_overlaps(boxes, TRUTH, (640, 480))) == 9


def test_got10k_clips_to_the_frame():
    truth = np.array([[0, 0, 10, 10], [90, 0, 20, 10.0]])
    boxes = np.array([[0, 0, 10, 10], [90, 0, 500, 10.0]])
    assert got10k_overlaps(boxes, truth, (100, 100)).tolist() == [1]
    np.testing.assert_array_equal(boxes[1], [90, 0, 500, 10])


def test_got10k_does_not_move_boxes_at_the_edge_of_the_frame():
    truth = np.tile([10.0, 0, 20, 20], (3, 1))
    boxes = np.tile([0.0, 0, 20, 20], (3, 1))
    assert got10k_overlaps(boxes, truth, (300, 200)) == pytest.approx([1 / 3, 1 / 3])


def test_ao_and_sr_are_over_all_frames():
    found = average_overlap([np.array([1.0, 0.75, 0.5]), np.array([0.6]), np.zeros(0)])
    assert found.ao == pytest.approx(2.85 / 4)
    assert (found.sr50, found.sr75) == (0.75, 0.25)
    assert np.isnan(average_overlap([]).ao)
    assert got10k_overlaps(np.full((3, 4), NAN), TRUTH[:3], (640, 480)).tolist() == [0, 0]
