"""A, R and EAO by vot-toolkit's conventions: known cases. See also test_official_toolkit.py."""

from dataclasses import astuple

import numpy as np
import pytest

from helpers.benchmark_runs import SIZE, square, tracked
from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures import vot_toolkit
from ssiam.evaluation.measures.eao import Interval
from ssiam.evaluation.measures.trajectory import Status, TrackedSequence, Trajectory

SHORT = Interval(5, 15)


def scores(*sequences, interval=SHORT):
    return vot_toolkit.scores(sequences, interval)


def test_the_ground_truth_has_perfect_scores():
    found = scores(tracked("i" + 29 * "t"))
    assert (found.accuracy, found.robustness, found.eao) == (1, 0, 1)
    assert (found.lost, found.frames) == (0, 30)


def test_exact_rectangles_have_less_overlap_with_polygons():
    truth = square(30)
    boxes = np.hstack([truth[:, :2], np.full((30, 2), 40.0)])
    status = np.array([Status.INITIALIZED] + 29 * [Status.TRACKED], np.int8)
    run = Trajectory(status, np.where(status[:, None] == Status.TRACKED, boxes, np.nan))
    found = scores(TrackedSequence(VideoSequence("one", (), truth, size_wh=SIZE), (run,)))
    assert found.accuracy == pytest.approx(40**2 / 41**2)


def test_sequences_are_weighted_by_length():
    never_lost, lost = tracked("i" + 59 * "t", "never lost"), tracked("ix----i" + 23 * "t", "lost")
    found = scores(never_lost, lost)
    assert found.robustness == pytest.approx((0 * 60 + 1 * 30) / 90)
    assert (found.lost, found.frames) == (1, 90)
    assert vot_toolkit.ar_point(found, 2)[0] == pytest.approx(np.exp(-30 * (1 / 3) / 45))


def test_a_failure_in_the_last_frames_counts():
    late = scores(tracked("i" + 16 * "t" + "x--"), interval=Interval(10, 16))
    # Frames 1..16 of one failed fragment of 17: the curve ends with the fragment.
    assert late.eao == pytest.approx(1)
    both = scores(
        tracked("i" + 16 * "t" + "x--"), tracked("i" + 29 * "t"), interval=Interval(18, 29)
    )
    lengths = np.arange(18, 30)
    assert both.eao == pytest.approx(np.mean((1 + 16 / lengths) / 2), abs=1e-6)


def test_the_curve_ends_with_the_longest_fragment():
    run = tracked("i" + 6 * "t" + "x----i" + 4 * "t" + "x--")
    assert scores(run, interval=Interval(3, 6)).eao < 1
    assert np.isnan(scores(run, interval=Interval(7, 12)).eao)


def test_accuracy_is_0_if_no_frame_counts():
    assert scores(tracked("i" + 8 * "t")).accuracy == 0


def test_repetitions_are_averaged():
    codes = "ittttx----i" + 19 * "t"
    once, thrice = (scores(tracked(codes, shift=3, repetitions=count)) for count in (1, 3))
    assert astuple(thrice) == pytest.approx(astuple(once))


def test_a_short_run_is_measured_over_its_frames():
    found = scores(tracked("i" + 24 * "t", length=40), interval=Interval(5, 30))
    assert (found.accuracy, found.frames, found.eao) == (1, 25, 1)
