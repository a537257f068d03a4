"""Summaries of a folder of results: names, order, speed, notes."""

import numpy as np
import pytest

from helpers.benched import write_run, write_vot_year
from helpers.benchmark_runs import square, tracked, trajectory
from ssiam.datasets import open_dataset
from ssiam.evaluation.measures.trajectory import Trajectory
from ssiam.evaluation.paper.summary import parse_label, parse_variant, success_of, summarize
from ssiam.evaluation.runs.result_files import ResultsError, vot_path, write_lines, write_vot
from ssiam.stabilize import StabilizerConfig

OFF, PAPER = StabilizerConfig("off"), StabilizerConfig("paper")
WHOLE = "i" + "." * 19


@pytest.fixture
def data(tmp_path):
    return open_dataset(write_vot_year(tmp_path / "VOT2018", {"one": 20, "two": 20}))


def run(out, label, names=("one", "two"), codes=WHOLE, times=None):
    for name in names:
        write_run(out, label, name, codes)
        if times is not None:
            write_lines(out / label / "times" / "baseline" / f"{name}.txt", times)


def test_entries_are_sorted_by_tracker_then_method(data, tmp_path):
    out = tmp_path / "out"
    labels = ["kcf-predict", "kcf-paper", "kcf-off", "kcf-paper-window=9", "csrt-paper", "b_mine"]
    for label in labels:
        run(out, label)
    (out / "notes").mkdir()
    found = summarize(out, data)
    assert [each.label for each in found.entries] == [
        *("b_mine", "csrt-paper", "kcf-off", "kcf-paper", "kcf-paper-window=9", "kcf-predict")
    ]
    assert [each.tracker for each in found.entries][:2] == ["b_mine", "csrt"]
    assert found.entries[0].config is None
    assert (found.dataset, found.year) == ("VOT2018", 2018)
    assert found.find("kcf", PAPER) is found.entries[3]
    assert found.find("kcf", OFF) is found.entries[2]
    assert found.find("csrt", OFF) is None
    assert found.find("magic", OFF) is None


def test_variants_are_named_only_if_there_are_several(data, tmp_path):
    out = tmp_path / "out"
    for label in ("kcf-off-threads=2", "kcf-paper-threads=2", "lite-off", "lite-off-threads=2"):
        run(out, label)
    names = {each.label: each.tracker for each in summarize(out, data).entries}
    assert names == {
        "kcf-off-threads=2": "kcf",
        "kcf-paper-threads=2": "kcf",
        "lite-off": "lite",
        "lite-off-threads=2": "lite (threads=2)",
    }


def test_plain_labels_have_no_runtime_options(data, tmp_path):
    run(tmp_path / "out", "kcf-paper-window=9-threads=2-weights=abc")
    (entry,) = summarize(tmp_path / "out", data).entries
    assert entry.plain_label == "kcf-paper-window=9"
    assert entry.config == PAPER.with_options(window=9)


def test_speed_is_that_of_frames_with_a_time(data, tmp_path):
    run(tmp_path / "out", "kcf-off", times=["0", "0.25", "0.75", "0"])
    run(tmp_path / "out", "csrt-off")
    csrt, kcf = summarize(tmp_path / "out", data).entries
    assert kcf.fps == 2
    assert np.isnan(csrt.fps)


def test_missing_and_damaged_times_are_noted(data, tmp_path):
    out = tmp_path / "out"
    run(out, "kcf-off", times=["0.5", "0.5"])
    times = out / "kcf-off" / "times" / "baseline"
    (times / "one.txt").unlink()
    found = summarize(out, data)
    assert f"{times}: no times of one" in found.notes
    assert found.entries[0].fps == 2
    (times / "one.txt").write_text("x\n")
    found = summarize(out, data)
    reason = "line 1: 'x' is not a line of numbers; its times are left out"
    assert f"{times / 'one.txt'}, {reason}" in found.notes
    assert found.entries[0].fps == 2


def test_missing_and_damaged_runs_are_noted(data, tmp_path):
    out = tmp_path / "out"
    run(out, "kcf-off", ["one"])
    found = summarize(out, data)
    assert "kcf-off: no baseline results of 1 of 2 sequences: two" in found.notes
    write_lines(vot_path(out / "kcf-off", "two"), ["x"])
    found = summarize(out, data)
    assert any(
        note.endswith("two_001.txt, line 1: 'x' is not a line of numbers; it is left out")
        for note in found.notes
    )
    assert list(found.entries[0].supervised) == ["one"]


def test_one_pass_runs_alone_are_noted(data, tmp_path):
    path = vot_path(tmp_path / "out" / "kcf-off", "one", experiment="unsupervised")
    write_vot(path, trajectory(WHOLE, square(20, 20.0)))
    times = tmp_path / "out" / "kcf-off" / "times" / "unsupervised" / "one.txt"
    write_lines(times, ["0.5", "0.5"])
    found = summarize(tmp_path / "out", data)
    (entry,) = found.entries
    assert (entry.scores, entry.eao_curve, entry.supervised) == (None, None, {})
    assert entry.fps == 2
    assert "VOT2018: no supervised runs of kcf-off (ssiam bench ... --protocol vot)" in found.notes
    assert not any("one-pass runs" in note for note in found.notes)


def test_at_most_four_names_are_listed(tmp_path):
    data = open_dataset(
        write_vot_year(tmp_path / "clips", dict.fromkeys(("a", "b", "c", "d", "e", "f"), 20))
    )
    for number in range(4):
        run(tmp_path / "out", f"kcf-paper-window={number + 1}", ["a"])
    found = summarize(tmp_path / "out", data)
    assert found.year is None
    listed = "b, c, d, e and 1 more"
    label = "kcf-paper-window=1"
    assert f"{label}: no baseline results of 5 of 6 sequences: {listed}" in found.notes
    labels = ", ".join(f"kcf-paper-window={number + 1}" for number in range(4))
    expected = f"clips: no one-pass runs of {labels} (ssiam bench ... --protocol ope)"
    assert found.notes[-1] == expected


def test_a_folder_without_results_is_refused(data, tmp_path):
    with pytest.raises(ResultsError) as caught:
        summarize(tmp_path / "none", data)
    expected = f"{tmp_path / 'none'}: no such folder; give --out of ssiam bench"
    assert str(caught.value) == expected
    (tmp_path / "empty" / "kcf-off").mkdir(parents=True)
    with pytest.raises(ResultsError) as caught:
        summarize(tmp_path / "empty", data)
    assert str(caught.value) == (
        f"{tmp_path / 'empty'}: no subfolder with baseline/SEQUENCE/SEQUENCE_001.txt; "
        "give --out of ssiam bench"
    )


def test_lost_targets_and_overlaps_of_each_sequence(data, tmp_path):
    out = tmp_path / "out"
    run(out, "kcf-off", ["one"], "i....x----i" + "." * 9)
    run(out, "kcf-off", ["two"])
    (entry,) = summarize(out, data).entries
    assert entry.lost == {"one": 1, "two": 0}
    assert entry.overlaps == pytest.approx({"one": 1, "two": 1}, abs=1e-3)


def test_a_loss_is_a_miss_and_starts_and_skipped_frames_do_not_count():
    each = tracked("i....x----i.........")
    # 4 and 9 tracked frames, and one loss.
    assert success_of(each, each.runs[0]).precision == pytest.approx(13 / 14)
    one_pass = tracked("i.........")
    assert success_of(one_pass, one_pass.runs[0]).precision == 1
    late = tracked("--i.......")
    assert success_of(late, late.runs[0]).precision == 1
    truth = square(10)
    far = Trajectory(late.runs[0].status, late.runs[0].regions + 500)
    assert success_of(late, far).precision == pytest.approx(1 / 8), "the start has the true box"
    assert np.array_equal(late.sequence.truth, truth), "the truth is not changed"


@pytest.mark.parametrize(
    ("label", "tracker", "config", "variant"),
    [
        ("kcf-off", "kcf", OFF, ""),
        ("a-b-paper", "a-b", PAPER, ""),
        ("kcf-paper-fit=least_squares", "kcf", PAPER.with_options(fit="least_squares"), ""),
        ("kcf-paper-threads=2-window=9", "kcf", PAPER.with_options(window=9), "threads=2"),
        ("kcf-off-distractors=True-device=cuda", "kcf", OFF, "distractors=True, device=cuda"),
    ],
)
def test_labels(label, tracker, config, variant):
    assert parse_label(label) == (tracker, config)
    assert parse_variant(label) == variant
