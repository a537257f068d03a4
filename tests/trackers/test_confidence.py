"""Logistic confidence scores, features of a box, and the running baseline."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.synthetic import generator
from ssiam.trackers import nanotrack, opencv
from ssiam.trackers.confidence import Confidence, RunningBaseline, box_feature

NUMBERS = st.floats(-1e300, 1e300)
MODEL = Confidence((0.5, 20.0), -1.0)
USED = [*nanotrack.CONFIDENCE.values(), *opencv._CONFIDENCE.values()]


@given(NUMBERS, NUMBERS)
def test_probabilities_are_within_0_and_1(first, second):
    assert 0 <= MODEL.probability((first, second)) <= 1


@pytest.mark.parametrize("model", [MODEL, *USED])
@given(a=st.floats(-20, 20), b=st.floats(-20, 20), other=st.floats(-1, 1))
def test_more_evidence_is_never_less_probable(model, a, b, other):
    low, high = sorted((a, b))
    assert model.probability((low, other)) <= model.probability((high, other))
    assert model.probability((other, low)) <= model.probability((other, high))


def test_the_model_is_the_logistic_one():
    for first, second in ((0.0, 0.0), (3.0, -0.1), (-2.0, 0.2)):
        logit = 0.5 * first + 20 * second - 1
        assert MODEL.probability((first, second)) == pytest.approx(1 / (1 + np.exp(-logit)))


def test_evidence_of_another_length_is_refused():
    with pytest.raises(ValueError, match="argument"):
        MODEL.probability((1.0,))


SIDE, STRIDE = 15, 16.0
POSITIONS = (np.arange(SIDE) - SIDE // 2) * STRIDE  # of the features, px from the crop's center


def features(inside, box):
    """A map of features (3, 0), with `inside` where the position is in the box."""
    cx, cy, w, h = box
    rows, columns = np.abs(POSITIONS - cy) <= h / 2, np.abs(POSITIONS - cx) <= w / 2
    maps = np.zeros((1, 2, SIDE, SIDE), np.float32)
    maps[0, 0] = 3.0
    maps[0][:, np.outer(rows, columns)] = np.array(inside, np.float32)[:, None]
    return maps


@pytest.mark.parametrize(
    "box",
    [
        pytest.param((0, 0, 64, 64), id="middle"),
        pytest.param((48, -32, 96, 40), id="wide"),
        pytest.param((-80, 60, 33, 90), id="high"),
        pytest.param((112, 112, 48, 48), id="corner"),
        pytest.param((16, 32, 1, 1), id="smaller than a cell"),
    ],
)
def test_only_features_in_the_box_are_averaged(box):
    """cx selects columns and cy rows."""
    feature = box_feature(features((0.0, 7.0), box), STRIDE, np.array(box, float))
    np.testing.assert_allclose(feature, (0, 1), atol=1e-12)


def test_the_feature_is_the_direction_of_the_mean():
    noise = generator(3).normal(0, 1, (1, 24, SIDE, SIDE)).astype(np.float32)
    feature = box_feature(noise, STRIDE, np.array([0.0, 0.0, 1e4, 1e4]))
    mean = noise[0].mean(axis=(1, 2), dtype=np.float64)
    np.testing.assert_allclose(feature, mean / np.linalg.norm(mean), atol=1e-6)
    part = box_feature(7 * noise, STRIDE, np.array([32.0, -16.0, 60.0, 80.0]))
    assert np.linalg.norm(part) == pytest.approx(1)
    np.testing.assert_allclose(
        part, box_feature(noise, STRIDE, np.array([32.0, -16.0, 60.0, 80.0])), atol=1e-6
    )


@pytest.mark.parametrize("cx", [-1e5, -200.0, 0.0, 200.0, 1e5])
@pytest.mark.parametrize("cy", [-1e5, 0.0, 1e5])
@pytest.mark.parametrize("extent", [0.1, 40.0, 1e5])
def test_boxes_outside_of_the_map_use_its_nearest_features(cx, cy, extent):
    coordinates = np.stack(np.meshgrid(POSITIONS, POSITIONS))[None].astype(np.float32)
    coordinates = np.concatenate([coordinates, np.full((1, 1, SIDE, SIDE), 64, np.float32)], axis=1)
    x, y, one = box_feature(coordinates, STRIDE, np.array([cx, cy, extent, extent]))
    assert np.hypot(np.hypot(x, y), one) == pytest.approx(1)
    if extent < 100:
        for found, position in ((x, cx), (y, cy)):
            nearest = np.clip(position, POSITIONS[0], POSITIONS[-1])
            assert abs(found / one * 64 - nearest) <= STRIDE


def test_zero_features_stay_zero():
    feature = box_feature(np.zeros((1, 5, 8, 8), np.float32), 16, np.array([0.0, 0.0, 30.0, 30.0]))
    np.testing.assert_array_equal(feature, 0)


def test_values_at_the_baseline_or_above_have_no_drop():
    baseline = RunningBaseline()
    assert all(baseline.update(value, confident=True) == 0 for value in (0.9, 0.9, 0.95, 0.9, 1.0))


def test_the_drop_grows_as_the_value_falls():
    def after(value):
        baseline = RunningBaseline()
        for _ in range(20):
            baseline.update(0.9, confident=True)
        return baseline.update(value, confident=False)

    drops = [after(value) for value in np.linspace(0.9, -1.0, 60)]
    assert drops[0] == 0
    assert drops[-1] < 0
    assert (np.diff(drops) <= 0).all()
    assert after(-1.0) == after(-1e6)  # saturated


@pytest.mark.parametrize("confident", [True, False])
def test_a_much_lower_value_changes_the_baseline_only_if_confident(confident):
    baseline = RunningBaseline()
    for _ in range(20):
        baseline.update(0.9, confident=True)
    first = baseline.update(0.2, confident)
    for _ in range(200):
        last = baseline.update(0.2, confident)
    assert first < 0
    assert last == (0 if confident else first)


def test_the_baseline_follows_faster_while_the_tracker_is_confident():
    values = {}
    for confident in (True, False):
        baseline = RunningBaseline()
        baseline.update(1.0, confident)
        baseline.update(2.0, confident)  # the mean moves up by a share of the difference
        values[confident] = baseline.update(1.0, confident)
    assert values[True] < values[False] <= 0
