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
