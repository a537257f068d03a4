"""Paired comparisons: known differences, width of the interval, seeds."""

import numpy as np
import pytest

from ssiam.errors import ArgumentError
from ssiam.evaluation.measures import compare
from ssiam.evaluation.measures.compare import paired_difference


def named(values):
    return {f"s{index}": float(value) for index, value in enumerate(values)}


def test_a_constant_difference_has_an_interval_of_width_0():
    rng = np.random.default_rng(0)
    values = rng.random(30)
    found = paired_difference(named(values + 0.25), named(values))
    assert (found.value, found.low, found.high) == pytest.approx((0.25, 0.25, 0.25))
    assert (found.share_below_zero, found.sequences) == (0, 30)


def test_swapping_the_sets_changes_the_sign():
    rng = np.random.default_rng(1)
    a, b = named(rng.random(25)), named(rng.random(25))
    forward, backward = paired_difference(a, b), paired_difference(b, a)
    assert forward.value == pytest.approx(-backward.value)
    assert (forward.low, forward.high) == pytest.approx((-backward.high, -backward.low))
    assert forward.share_below_zero == pytest.approx(1 - backward.share_below_zero, abs=1e-3)


def test_the_interval_is_the_standard_error_of_the_mean():
    values = np.random.default_rng(2).normal(0.1, 1, 400)
    found = paired_difference(named(values), named(np.zeros(400)))
    half = 1.96 * values.std() / 20
    assert found.value == pytest.approx(values.mean())
    assert found.high - found.low == pytest.approx(2 * half, rel=0.05)


def test_sum_over_sequences():
    found = paired_difference(named([3, 1, 0, 2]), named([1, 1, 1, 1]), over="sum")
    assert found.value == 2
    assert found.low <= 2 <= found.high
    assert 0 < found.share_below_zero < 0.5


def test_the_same_seed_gives_the_same_interval():
    a, b = named(np.arange(10.0) ** 1.5), named(np.arange(10.0)[::-1])
    assert paired_difference(a, b) == paired_difference(a, b)
    assert paired_difference(a, b, seed=1) != paired_difference(a, b)


def test_only_common_sequences_count():
    a = {"x": 1.0, "y": 2.0, "z": float("nan"), "mine": 9.0}
    found = paired_difference(a, {"x": 0.0, "y": 1.0, "z": 0.0, "theirs": 9.0})
    assert (found.value, found.sequences) == (1, 2)


@pytest.mark.parametrize("other", [{}, {"b": 1.0}, {"a": float("nan")}])
def test_no_common_sequence(other):
    with pytest.raises(ArgumentError, match="no sequence in common"):
        paired_difference({"a": 1.0}, other)


def test_unknown_comparison():
    with pytest.raises(ArgumentError, match="mean, sum"):
        paired_difference({"a": 1.0}, {"a": 1.0}, over="median")


def test_resamples_and_seed_by_default():
    a, b = named([3, 1, 0, 2, 5]), named([1, 1, 1, 1, 4])
    assert paired_difference(a, b) == paired_difference(a, b, resamples=10_000, seed=0)
    few = paired_difference(a, b, resamples=8)
    assert (8 * few.share_below_zero).is_integer()
    assert paired_difference(a, b, resamples=9_999) != paired_difference(a, b)


def test_resamples_are_drawn_in_parts(monkeypatch):
    """The numbers are the same, in whatever parts they are drawn."""
    a, b = named([3, 1, 0, 2, 5]), named([1, 1, 1, 1, 4])
    whole = paired_difference(a, b, resamples=100)
    for batch in (1, 4, 35, 499):
        monkeypatch.setattr(compare, "_BATCH", batch)
        assert paired_difference(a, b, resamples=100) == whole


def test_the_interval_has_the_percentiles_of_the_resampled_means():
    values = np.array([3.0, -1, 0, 2, 5])
    drawn = np.random.default_rng(0).integers(0, 5, (10_000, 5))
    means = values[drawn].mean(axis=1)
    for over, factor in (("mean", 1), ("sum", 5)):
        found = paired_difference(named(values), named(np.zeros(5)), over=over)
        expected = np.percentile(means, (2.5, 97.5)) * factor
        assert (found.low, found.high) == pytest.approx(tuple(expected))
        assert found.share_below_zero == (means < 0).mean()
        assert found.value == pytest.approx(1.8 * factor)
    assert all(type(each) is float for each in (found.value, found.low, found.share_below_zero))


def test_equal_results_are_not_below():
    found = paired_difference(named([1, 2]), named([1, 2]))
    assert found == compare.Difference(0, 0, 0, 0, 2)
