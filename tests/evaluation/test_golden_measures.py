"""Overlaps, A, R and EAO against pysot-toolkit's on synthetic data."""

import numpy as np
import pytest

from helpers.benchmark_runs import golden_runs, tracked
from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures import pysot, vot_toolkit
from ssiam.evaluation.measures.eao import INTERVALS, Interval
from ssiam.evaluation.measures.overlap import vot_overlap
from ssiam.evaluation.measures.trajectory import Status, TrackedSequence, Trajectory


@pytest.mark.parametrize(
    ("values", "other", "bounds"),
    [
        ("overlap_poly_bound_wh", "poly_b", (320, 240)),
        ("overlap_rect_bound_wh", "rect_b", (320, 240)),
        ("overlap_poly_bound_wm1_hm1", "poly_b", (319, 239)),
        ("overlap_poly_nobound", "poly_b", None),
    ],
)
def test_overlaps_are_pysots(golden, values, other, bounds):
    data = golden("vot_overlap.npz")
    found = vot_overlap(data["poly_a"], data[other], bounds)
    np.testing.assert_allclose(found, data[values], atol=1e-6)


def test_overlaps_of_runs_are_pysots(golden):
    """Of accuracy within (W, H) and after the burn-in, of EAO within (W - 1, H - 1)."""
    data = golden("vot_eval.npz")
    for run in golden_runs(data):
        (one,) = pysot.measure(run).overlaps
        for found, key in ((one.accuracy, "burnin10"), (one.eao, "eao")):
            np.testing.assert_allclose(found, data[f"{run.name}_overlaps_{key}"], atol=1e-6)


def test_accuracy_counts_a_column_at_the_border_that_eao_leaves_out():
    """Columns 300 to 320 of the ground truth in a frame 320 pixels wide, 300 to 310 of the box."""
    truth, boxes = (np.tile([300.0, 100.0, w, 50.0], (12, 1)) for w in (40.0, 10.0))
    status = np.full(12, Status.TRACKED, np.int8)
    status[0], boxes[0] = Status.INITIALIZED, np.nan
    sequence = VideoSequence("border", (), truth, size_wh=(320, 240))
    measured = pysot.measure(TrackedSequence(sequence, (Trajectory(status, boxes),)))
    assert measured.overlaps[0].accuracy[11] == pytest.approx(11 / 21)
    assert measured.overlaps[0].eao[11] == pytest.approx(11 / 20)


@pytest.mark.parametrize("year", [2016, 2018, 2019])
def test_scores_are_pysots(golden, year):
    data = golden("vot_eval.npz")
    runs = [pysot.measure(each) for each in golden_runs(data)]
    found = pysot.scores(runs, INTERVALS[year], "all")
    values = [found.accuracy, found.robustness, found.eao, found.lost, found.frames]
    np.testing.assert_allclose(values, data[f"VOT{year}"], atol=1e-6)


@pytest.mark.parametrize(
    ("frames", "counts"), [pytest.param(10, False, id="10"), pytest.param(11, True, id="11")]
)
@pytest.mark.parametrize("toolkit", [pysot, vot_toolkit])
def test_accuracy_leaves_out_10_frames_from_each_start_on(toolkit, frames, counts):
    """The initialized frame is the first of them."""
    run = tracked("i" + (frames - 1) * "t", shift=1.0)
    measured = [pysot.measure(run)] if toolkit is pysot else [run]
    accuracy = toolkit.scores(measured, Interval(2, 5)).accuracy
    assert bool(accuracy > 0) == counts  # nan or 0 without any frame
