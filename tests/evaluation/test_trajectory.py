"""Trajectories: shapes, burn-in and cutting."""

import numpy as np
import pytest

from helpers.benchmark_runs import square, trajectory
from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.trajectory import Trajectory

SHAPES = [
    # name, statuses, regions, words of the message
    ("five columns", np.zeros(3, np.int8), np.zeros((3, 5)), "shape (3, 5)"),
    ("a list of numbers", np.zeros(3, np.int8), np.zeros(3), "shape (3,)"),
    ("too few statuses", np.zeros(2, np.int8), np.zeros((3, 4)), "2 statuses for 3 regions"),
]


@pytest.mark.parametrize(
    ("status", "regions", "words"), [pytest.param(*case[1:], id=case[0]) for case in SHAPES]
)
def test_shapes_are_checked(status, regions, words):
    with pytest.raises(ArgumentError) as caught:
        Trajectory(status, regions)
    assert words in str(caught.value)


def test_burn_in_after_each_start():
    run = trajectory("ittttx--itt", square(11))
    assert np.flatnonzero(run.burn_in(4)).tolist() == [0, 1, 2, 3, 8, 9, 10]


def test_first_frames():
    run = Trajectory.from_regions(square(5), seconds=np.arange(5.0))
    assert run.first(2).seconds.tolist() == [0, 1]
    assert len(run.first(9)) == 5


def test_runs_of_whole_numbers_are_floats():
    run = Trajectory.from_regions([[1, 2, 3, 4], [5, 6, 7, 8]], seconds=[1, 2])
    assert run.regions.dtype == run.seconds.dtype == np.float64
    assert run.status.dtype == np.int8
    assert run.status.tolist() == [3, 3]
    assert Trajectory.from_regions([[1, 2, 3, 4]]).seconds is None


def test_missing_regions_are_skipped_and_nan():
    rows = np.array([[1.0, 2, 3, 4], [np.nan, 2, 3, 4]])
    run = Trajectory.from_regions(rows)
    assert run.status.tolist() == [3, 0]
    assert np.isnan(run.regions[1]).all()
    assert rows[1, 1] == 2, "the given array is not changed"


def test_times_have_the_number_of_regions():
    with pytest.raises(ArgumentError, match="3 times for 2 regions"):
        Trajectory(np.zeros(2, np.int8), np.zeros((2, 4)), np.zeros(3))


def test_frames_of_starts_and_failures():
    run = trajectory("ittttx--itt", square(11))
    assert run.failures.tolist() == [5]
    assert run.initializations.tolist() == [0, 8]
    assert run.burn_in(0).sum() == 0
    assert run.burn_in(1).dtype == np.bool_
    assert len(run.first(4)) == 4
    assert run.first(4).seconds is None
