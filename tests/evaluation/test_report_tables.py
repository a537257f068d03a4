"""Reports of ``ssiam eval``: which runs are compared, and the cells of the tables."""

import json

import numpy as np
import pytest

from helpers.benchmark_runs import square, tracked, trajectory
from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.compare import Difference
from ssiam.evaluation.measures.eao import Interval, Scores
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.reports import (
    Comparison,
    OnePassReport,
    TrackerReport,
    compared,
    comparisons_table,
    holds_one_pass,
    one_pass,
    one_pass_table,
    report,
    scores_table,
    tags_table,
)
from ssiam.evaluation.runs.result_files import (
    ResultsError,
    TrackerResults,
    got10k_path,
    otb_path,
    vot_path,
    write_boxes,
    write_vot,
)

NAN = float("nan")
SCORES = Scores(0.6124, 0.25, NAN, 2.5, 1000)
OFFICIAL = Scores(0.5, 0.125, 0.375, 3, 900)


def tracker_report(name, **values):
    empty = {"pysot": SCORES, "vot_toolkit": OFFICIAL, "by_tag": {}, "accuracy": {}, "lost": {}}
    return TrackerReport(name, **{**empty, "notes": (), **values})


def cells(table):
    return list(zip(*(column.cells for column in table.columns), strict=True))


def test_a_row_has_the_scores_of_both_toolkits():
    assert cells(scores_table([tracker_report("kcf[x]-off")])) == [
        ("kcf\\[x]-off", "0.612", "0.250", "-", "2.5", "0.500", "0.125", "0.375")
    ]
    table = scores_table([tracker_report("a"), tracker_report("b")])
    assert [row[0] for row in cells(table)] == ["a", "b"]
    assert table.title == "pysot's conventions, then vot-toolkit's"
    assert [column.justify for column in table.columns] == ["left"] + ["right"] * 7


def test_tags_have_a_row_each():
    tags = {"camera_motion": OFFICIAL, "[b]": SCORES}
    table = tags_table([tracker_report("a", by_tag=tags), tracker_report("b")])
    assert cells(table)[0] == ("a", "camera_motion", "0.500", "0.125", "0.375", "3", "900")
    assert cells(table)[1][:2] == ("a", "\\[b]")
    assert cells(table)[1][-2:] == ("2.5", "1000")
    assert table.title == "by tag, pysot's conventions"
    assert [column.justify for column in table.columns] == ["left"] * 2 + ["right"] * 5


def test_scores_for_json():
    found = tracker_report("a").as_dict()
    assert found == {
        "pysot": {
            "accuracy": 0.6124,
            "robustness": 0.25,
            "eao": None,
            "lost": 2.5,
            "frames": 1000,
        },
        "vot_toolkit": {
            "accuracy": 0.5,
            "robustness": 0.125,
            "eao": 0.375,
            "lost": 3,
            "frames": 900,
        },
    }
    json.dumps(found, allow_nan=False)


MORE = Difference(0.0126, -0.01, 0.03, 0.125, 4)
FEWER = Difference(-2.0, -4.24, 1.0, 0.25, 4)


def test_comparisons_have_their_differences_and_shares():
    table = comparisons_table(
        [Comparison("a[x]", "b[y]", MORE, FEWER), Comparison("a", "b", None, None)]
    )
    first, second = cells(table)
    assert first[:6] == ("a\\[x]", "b\\[y]", "+0.013", "-0.010 .. +0.030", "12.5 %", "-2.0")
    assert first[6:] == ("-4.2 .. +1.0", "25.0 %")
    assert second == ("a", "b", *["-"] * 6)
    assert [column.header for column in table.columns] == [
        *("tracker", "minus", "accuracy", "95 % within", "lower in"),
        *("lost", "95 % within", "fewer in"),
    ]
    assert table.title == "differences, with shares of the resampled sequences"
    assert [column.justify for column in table.columns] == ["left"] * 2 + ["right"] * 6


def test_comparisons_for_json():
    assert Comparison("a", "b", None, None).as_dict() == {
        "reference": "b",
        "accuracy": None,
        "lost": None,
    }
    found = Comparison("a", "b", MORE, FEWER).as_dict()
    assert found["accuracy"] == {
        "value": 0.0126,
        "low": -0.01,
        "high": 0.03,
        "share_below_zero": 0.125,
        "sequences": 4,
    }
    assert found["lost"]["value"] == -2
    nothing = Difference(NAN, NAN, NAN, NAN, 0)
    empty = Comparison("a", "b", nothing, None).as_dict()["accuracy"]
    assert empty == {**dict.fromkeys(found["accuracy"]), "sequences": 0}


def pairs(*names):
    reports = [tracker_report(name, accuracy={"x": 0.5}, lost={"x": 1.0}) for name in names]
    return [(each.name, each.reference) for each in compared(reports)]


def test_stabilized_runs_are_compared_with_the_tracker_alone():
    assert pairs("csrt-off", "kcf-off", "kcf-paper", "kcf-predict") == [
        ("kcf-paper", "kcf-off"),
        ("kcf-predict", "kcf-off"),
    ]
    assert pairs("kcf-paper-window=9", "kcf-off") == [("kcf-paper-window=9", "kcf-off")]
    assert pairs("kcf-off-threads=4", "kcf-off", "kcf-paper-window=9-threads=4") == [
        ("kcf-off", "kcf-off-threads=4"),
        ("kcf-paper-window=9-threads=4", "kcf-off-threads=4"),
    ]


def test_other_runs_are_compared_with_the_first():
    assert pairs("one", "two", "three") == [("two", "one"), ("three", "one")]
    assert pairs("kcf-off", "csrt-off") == [("csrt-off", "kcf-off")]
    assert pairs("kcf-paper") == []
    assert pairs() == []


def test_differences_are_of_common_sequences():
    first = tracker_report("one", accuracy={"x": 0.5, "y": 0.25}, lost={"x": 1.0, "y": 2.0})
    second = tracker_report("two", accuracy={"x": 0.75, "z": 0.5}, lost={"x": 3.0, "z": 9.0})
    (found,) = compared([first, second])
    assert (found.accuracy.value, found.accuracy.sequences) == (0.25, 1)
    assert (found.lost.value, found.lost.sequences) == (2, 1)
    other = tracker_report("three", accuracy={"z": 0.5}, lost={"x": NAN})
    (found,) = compared([first, other])
    assert (found.accuracy, found.lost) == (None, None)
    both = {"x": 1.0, "y": 2.0}
    first, second = (
        tracker_report(name, accuracy=both, lost={key: scale * n for key, n in both.items()})
        for name, scale in (("one", 1), ("two", 3))
    )
    (found,) = compared([first, second])
    assert found.accuracy.value == 0
    assert found.lost.value == 6, "the sum"


def test_a_report_has_the_measures_of_each_sequence_and_tag():
    length = 20
    tags = {
        "occlusion": np.arange(length) < 5,
        "camera_motion": np.arange(length) > 9,
        "never": np.zeros(length, bool),
        "all": np.ones(length, bool),
    }
    runs = (
        tracked("i" + "." * 19, "one", 4.0, tags=tags),
        tracked("i...x----i" + "." * 10, "two"),
    )
    found = report(TrackerResults("mine", runs, ("note",)), Interval(5, 15))
    assert found.name == "mine"
    assert list(found.by_tag) == ["camera_motion", "occlusion"]
    assert found.lost == {"one": 0, "two": 1}
    assert found.accuracy["two"] == pytest.approx(1)
    assert 0.5 < found.accuracy["one"] < 0.9
    assert found.pysot.lost == found.vot_toolkit.lost == 1
    assert found.notes == ("note",)
    (note,) = report(TrackerResults("mine", runs, ()), Interval(5, 20)).notes
    assert note == (
        "mine: EAO is defined over lengths 5 to 20, and no sequence has more than 20 frames; it is "
        "the mean over the lengths that exist"
    )
    alone = report(TrackerResults("mine", runs, ()), None)
    assert alone.notes == ()
    assert np.isnan(alone.pysot.eao)


TRUTH = np.tile([10.0, 20, 30, 40], (6, 1))


def sequence(name="s", count=6):
    return VideoSequence(name, (), TRUTH[:count])


def write_one_pass(folder, kind, boxes=TRUTH):
    run = Trajectory.from_regions(boxes)
    if kind == "ope":
        write_boxes(otb_path(folder / "ope", "s"), run)
    elif kind == "otb":
        write_boxes(otb_path(folder, "s"), run)
    elif kind == "got10k":
        write_boxes(got10k_path(folder, "s"), run, origin=0)
    else:
        write_vot(vot_path(folder, "s", experiment="unsupervised"), run)


@pytest.mark.parametrize("kind", ["ope", "otb", "got10k", "vot"])
def test_each_layout_of_one_pass_results_is_read(tmp_path, kind):
    assert not holds_one_pass(tmp_path)
    write_one_pass(tmp_path, kind)
    assert holds_one_pass(tmp_path)
    found = one_pass(tmp_path, [sequence()])
    assert found == OnePassReport(tmp_path.name, found.success, 1, 1, 1, 1, 1, 1)
    assert found.success > 0.9
    assert found.ao == 1


def test_supervised_results_are_no_one_pass_results(tmp_path):
    write_vot(vot_path(tmp_path, "s"), trajectory("itt", square(3)))
    assert not holds_one_pass(tmp_path)
    with pytest.raises(ResultsError) as caught:
        one_pass(tmp_path, [sequence()])
    assert str(caught.value) == f"{tmp_path}: no one-pass results of the dataset"


def test_the_layouts_have_an_order(tmp_path):
    for share, kind in ((2, "vot"), (3, "got10k"), (4, "otb"), (5, "ope")):
        boxes = TRUTH.copy()
        boxes[:, 2] /= share
        write_one_pass(tmp_path, kind, boxes)
        assert one_pass(tmp_path, [sequence()]).ao == pytest.approx(1 / share, abs=0.01)


def test_missing_and_short_results_are_noted(tmp_path):
    write_one_pass(tmp_path, "otb", TRUTH[:4])
    found = one_pass(tmp_path, [sequence("other"), sequence()])
    assert found.sequences == 1
    assert found.notes == (
        f"{tmp_path}: no results for sequence other; it is left out",
        f"{tmp_path}: 4 lines for the 6 frames of s; missing frames count as misses",
    )
    assert found.precision == pytest.approx(4 / 6)
    write_one_pass(tmp_path, "otb")
    found = one_pass(tmp_path, [sequence(count=5)])
    assert found.notes == (
        f"{tmp_path}: 6 lines for the 5 frames of s; missing frames count as misses",
    )
    assert found.precision == 1


def test_the_start_has_the_true_box_and_skipped_frames_are_misses(tmp_path):
    status = np.array([1, 3, 0, 3, 3, 3], np.int8)
    regions = np.where(status[:, None] == Status.TRACKED, TRUTH, np.nan)
    write_vot(vot_path(tmp_path, "s", experiment="unsupervised"), Trajectory(status, regions))
    found = one_pass(tmp_path, [sequence()])
    assert found.precision == pytest.approx(5 / 6)


def test_figures_of_one_pass_runs():
    found = OnePassReport("a[x]", 0.5, 0.25, NAN, 0.125, 0.75, 1.0, 3, ("note",))
    names = ["success", "precision", "normalised_precision", "ao", "sr50", "sr75", "sequences"]
    assert list(found.as_dict()) == names
    assert list(found.as_dict().values()) == [0.5, 0.25, None, 0.125, 0.75, 1.0, 3]
    table = one_pass_table([found])
    assert [column.header for column in table.columns] == ["tracker", *names]
    (row,) = cells(table)
    assert row[:3] == ("a\\[x]", "0.500", "0.250")
    assert row[4:] == ("0.125", "0.750", "1.000", "3")
