"""A, R and EAO by pysot's conventions: known cases, golden numbers, published raw results."""

from dataclasses import astuple

import numpy as np
import pytest

from helpers.benchmark_runs import SIZE, square, tracked, trajectory
from ssiam.datasets import VideoSequence, open_dataset
from ssiam.errors import ArgumentError
from ssiam.evaluation.measures import pysot
from ssiam.evaluation.measures.eao import (
    INTERVALS,
    Fragment,
    Interval,
    expected_overlap,
    interval_of,
    mean_or_nan,
)
from ssiam.evaluation.measures.overlap import vot_overlap
from ssiam.evaluation.measures.trajectory import TrackedSequence
from ssiam.evaluation.runs.result_files import read_results

SHORT = Interval(5, 15)


def scores(*sequences, interval=SHORT, tag="all"):
    return pysot.scores([pysot.measure(each) for each in sequences], interval, tag)


def test_the_ground_truth_has_perfect_scores():
    found = scores(tracked("i" + 29 * "t"))
    assert (found.accuracy, found.robustness, found.eao) == (1, 0, 1)
    assert (found.lost, found.frames) == (0, 30)


RUNS = [
    # name, codes, lost, robustness, length of each fragment and whether it failed
    ("never lost", "i" + 19 * "t", 0, 0, [(20, False)]),
    ("lost once", "ittttx----i" + 9 * "t", 1, 5, [(11, True), (10, False)]),
    ("lost in the last frames", "i" + 16 * "t" + "x--", 1, 5, [(20, False)]),
    ("lost five frames before the end", "i" + 14 * "t" + "x----", 1, 5, [(20, True)]),
    ("lost at once, twice", "ix----ix----i" + 7 * "t", 2, 10, [(7, True), (7, True), (8, False)]),
]


@pytest.mark.parametrize(
    ("codes", "lost", "robustness", "lengths"),
    [pytest.param(*case[1:], id=case[0]) for case in RUNS],
)
def test_fragments_extend_from_start_to_start(codes, lost, robustness, lengths):
    run = tracked(codes)
    found = scores(run)
    assert (found.lost, found.robustness, found.frames) == (lost, robustness, 20)
    (one,) = pysot.measure(run).overlaps
    fragments = list(pysot._fragments(one, np.ones(20, bool), 1.0))
    assert [(len(each.overlaps), each.failed) for each in fragments] == lengths


def test_accuracy_leaves_out_burn_in_and_lost_frames():
    codes = "i" + 14 * "t" + "x----i" + 12 * "t"
    (one,) = pysot.measure(tracked(codes, shift=2)).overlaps
    assert np.flatnonzero(~np.isnan(one.accuracy)).tolist() == [10, 11, 12, 13, 14, 30, 31, 32]
    assert np.isnan(one.eao[[0, 15, 16, 19, 20]]).all()


def test_accuracy_is_the_mean_over_frames_not_over_sequences():
    exact, shifted = tracked("i" + 109 * "t", "exact"), tracked("i" + 19 * "t", "shifted", shift=10)
    low = pysot.measure(shifted).accuracy
    assert scores(exact, shifted).accuracy == pytest.approx((100 + 10 * low) / 110)


def test_repetitions_count_as_one_run():
    codes = "ittttx----i" + 19 * "t"
    once, thrice = (scores(tracked(codes, shift=3, repetitions=count)) for count in (1, 3))
    assert astuple(thrice) == pytest.approx(astuple(once))


def test_repetitions_that_differ_are_averaged():
    truth = square(30)
    runs = tuple(trajectory(c + 24 * "t", truth, 1.0) for c in ("it" + 4 * "t", "ix----"))
    sequence = VideoSequence("one", (), truth, size_wh=SIZE)
    found = scores(TrackedSequence(sequence, runs))
    assert (found.lost, found.robustness, found.frames) == (0.5, pytest.approx(50 / 30), 30)


def test_a_tag_selects_its_frames():
    tags = {"camera_motion": np.arange(40) < 20, "occlusion": np.zeros(40, bool)}
    run = tracked("i" + 14 * "t" + "x----i" + 19 * "t", shift=2, tags=tags)
    moving, hidden, unknown = (
        scores(run, tag=tag) for tag in ("camera_motion", "occlusion", "rain")
    )
    assert (moving.lost, moving.frames, moving.robustness) == (1, 20, 5)
    # All tagged frames are in the failed fragment, which therefore has more weight.
    late = Interval(20, 20)
    assert scores(run, interval=late, tag="camera_motion").eao < scores(run, interval=late).eao
    assert hidden.frames == unknown.frames == 0
    assert np.isnan([hidden.accuracy, hidden.robustness, hidden.eao]).all()


def test_a_short_run_is_measured_over_its_frames():
    found = scores(tracked("i" + 24 * "t", length=40))
    assert (found.frames, found.accuracy) == (25, 1)


def test_eao_is_nan_if_no_run_is_long_enough():
    assert np.isnan(scores(tracked("itttt"), interval=Interval(10, 20)).eao)


def test_the_frame_size_is_required():
    sequence = VideoSequence("bag", (), square(5))
    with pytest.raises(ArgumentError, match="bag: the size of the frames"):
        pysot.measure(TrackedSequence(sequence, (trajectory("itttt", square(5)),)))


def test_the_curve_of_two_fragments():
    fragments = [
        Fragment(np.array([np.nan, 0.5, 0.5]), True, 1.0),
        Fragment(np.array([1.0, 1.0, 1.0, 0.4]), False, 3.0),
    ]
    expected = [1, (0.5 + 3) / 4, (0.5 + 3) / 4, (1 / 3 + 3 * 0.8) / 4, 0.25]
    np.testing.assert_allclose(expected_overlap(fragments, 5), expected)


YEARS = [
    ("VOT2018", None, (100, 356)),
    ("VOT2017", None, (100, 356)),
    ("vot-2016", None, (108, 371)),
    ("my_vot2019_copy", None, (46, 291)),
    ("sequences", 2019, (46, 291)),
    ("VOT2018", 2016, (108, 371)),
]


@pytest.mark.parametrize(("name", "year", "interval"), YEARS)
def test_the_interval_of_a_year(name, year, interval):
    assert interval_of(name, year) == interval


def test_unknown_years_are_refused():
    known = r"\(2015, 2016, 2017, 2018, 2019\)"
    with pytest.raises(ArgumentError, match=rf"VOT2012 .* give --year {known}"):
        interval_of("VOT2018", 2012)


@pytest.mark.parametrize("name", ["OTB100", "VOT2013", "VOT2021"])
def test_datasets_without_eao_have_no_interval(name):
    assert interval_of(name) is None


PUBLISHED = [
    # folder, A, R, EAO, lost: the authors' table of SiamMask_E, VOT2018
    ("model_SiamRPN", 0.601, 0.234, 0.4154, 50),
    ("model_SiamMask", 0.598, 0.248, 0.4063, 53),
    ("model_SiamMask_E", 0.627, 0.248, 0.4266, 53),
    ("model_SiamMask_E_ref", 0.655, 0.253, 0.4457, 54),
]


@pytest.fixture(scope="module")
def vot2018():
    from conftest import SHARED

    path = SHARED / "data" / "vot" / "VOT2018.json"
    if not path.exists():
        pytest.skip(f"{path} is absent (set SSIAM_SHARED to the folder of the test data)")
    return list(open_dataset(path).sequences.values())


@pytest.mark.parametrize(("folder", "accuracy", "robustness", "eao", "lost"), PUBLISHED)
def test_published_scores_of_raw_results(shared, vot2018, folder, accuracy, robustness, eao, lost):
    results = read_results(shared(f"data/vot/results/VOT2018/{folder}"), vot2018)
    assert results.notes == ()
    found = scores(*results.tracked, interval=INTERVALS[2018])
    assert found.accuracy == pytest.approx(accuracy, abs=0.002)
    assert round(found.robustness, 3) == robustness
    assert found.eao == pytest.approx(eao, abs=0.001)
    assert (found.lost, found.frames) == (lost, 21356)


@pytest.mark.filterwarnings("error")
def test_the_mean_of_no_known_values_is_nan_without_a_warning():
    assert np.isnan(mean_or_nan(np.array([np.nan, np.nan])))
    assert np.isnan(mean_or_nan(np.array([])))
    assert mean_or_nan(np.array([np.nan, 0.25, 0.75])) == 0.5


def overlaps_of(values, codes=None):
    values = np.array(values, float)
    run = trajectory(codes or "i" + (len(values) - 1) * "t", square(len(values)))
    return pysot.Overlaps(run, values, values)


def test_the_mean_of_runs_of_different_lengths():
    first, second = overlaps_of([np.nan, 0.5, 0.25, np.nan]), overlaps_of([np.nan, 1.0])
    found = pysot._mean_of_runs([first, second])
    np.testing.assert_array_equal(found, [np.nan, 0.75, 0.25, np.nan])
    both = pysot.MeasuredSequence(tracked("itttt"), (first, second))
    assert both.accuracy == 0.5


def test_fragments_have_the_share_of_tagged_frames():
    """Of a failed fragment up to the next start; of the last one of the sequence's frames."""
    tagged = np.zeros(24, bool)
    tagged[4:10] = True
    run = overlaps_of(np.linspace(0, 1, 20), "i" + 3 * "t" + "x----i" + 10 * "t")
    first, last = pysot._fragments(run, tagged, 0.5)
    assert (len(first.overlaps), first.failed) == (10, True)
    assert first.weight == pytest.approx(0.5 * 6 / 10)
    assert (len(last.overlaps), last.failed) == (11, False)
    assert last.weight == pytest.approx(0.5 * 1 / 15)


def test_bounds_of_accuracy_and_eao_differ_by_a_pixel():
    """The region reaches the last column of the frame, which EAO does not count."""
    width, height = SIZE
    truth = np.tile([width - 11.0, 10, 10, 20], (12, 1))
    sequence = VideoSequence("one", (), truth, size_wh=SIZE)
    run = trajectory("i" + 11 * "t", truth)
    regions = run.regions.copy()
    regions[:, 2] = 9
    shorter = type(run)(run.status, regions)
    (found,) = pysot.measure(TrackedSequence(sequence, (shorter,))).overlaps
    assert found.accuracy[11] == pytest.approx(
        vot_overlap(regions[11:], truth[11:], (width, height))[0]
    )
    assert found.eao[11] == pytest.approx(
        vot_overlap(regions[11:], truth[11:], (width - 1, height - 1))[0]
    )


def test_eao_is_the_mean_of_the_curve_over_the_interval():
    run = tracked("i" + 14 * "t", shift=2)
    assert np.isnan(scores(run, interval=None).eao)
    low, high = Interval(3, 5)
    curve = pysot.eao_curve([pysot.measure(run)])
    assert scores(run, interval=Interval(3, 5)).eao == pytest.approx(curve[low - 1 : high].mean())
    assert np.isnan(scores(run, tag="rain").robustness)
