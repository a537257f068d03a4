"""Strips: which sequences and frames they show."""

import numpy as np
import pytest

from helpers.benched import write_run, write_vot_year
from ssiam.datasets import VideoSequence, open_dataset
from ssiam.evaluation.paper.canvas import NothingToDrawError
from ssiam.evaluation.paper.qualitative import Example
from ssiam.evaluation.paper.strips import PAPER_SEQUENCES, examples, failures, gain, results
from ssiam.evaluation.paper.summary import summarize

LOST = "i" + "." * 19 + "x----i" + "." * 14
WHOLE = "i" + "." * 39


def example(off, stabilized, name="s"):
    truth = np.tile([10.0, 10, 20, 20], (len(off), 1))
    boxes = []
    for overlaps in (off, stabilized):
        each = truth.copy()
        each[:, 2] *= overlaps  # a narrower box with exactly this overlap
        each[np.asarray(overlaps) == 0] = np.nan
        boxes.append(each)
    return Example("kcf", VideoSequence(name, (), truth), False, truth, *boxes)


def found(tmp_path, runs, names=("one", "two")):
    """Summaries of runs by label and sequence."""
    data = write_vot_year(tmp_path / "VOT2018", dict.fromkeys(names, 40))
    for (label, name), codes in runs.items():
        write_run(tmp_path / "out", label, name, codes)
    return summarize(tmp_path / "out", open_dataset(data))


def test_failures_show_the_first_frame_and_those_up_to_the_first_loss():
    off = np.full(60, 0.8)
    off[[31, 32, 50]] = 0
    (strip,) = failures([example(off, np.full(60, 0.9)), example(np.ones(60), np.ones(60))])
    assert strip.frames == (0, 28, 29, 30, 31)


def test_a_loss_without_enough_frames_before_it_is_not_shown():
    off = np.full(60, 0.8)
    off[2] = 0
    with pytest.raises(NothingToDrawError, match="lost no target"):
        failures([example(off, off)])


def test_results_show_the_first_frame_and_those_with_the_largest_gain():
    off, stabilized = np.full(90, 0.5), np.full(90, 0.6)
    off[[20, 21, 44, 60]] = 0.1, 0.0, 0.0, 0.2
    stabilized[70] = 0.9
    stabilized[80] = 0.0  # a large difference, but for the worse
    (strip,) = results([example(off, stabilized)])
    assert strip.frames == (0, 21, 44, 60, 70)


def test_the_sequence_with_the_largest_gain_comes_first(tmp_path):
    runs = {
        ("kcf-off", "one"): WHOLE,
        ("kcf-paper", "one"): WHOLE,
        ("kcf-off", "two"): LOST,
        ("kcf-paper", "two"): WHOLE,
    }
    shown = examples(found(tmp_path, runs))
    assert [each.sequence.name for each in shown] == ["two", "one"]
    assert gain(shown[0]) > gain(shown[1]) == 0
    (strip,) = failures(shown)
    assert strip.frames == (0, 17, 18, 19, 20)


def test_a_restart_is_not_a_loss(tmp_path):
    runs = {("kcf-off", "one"): LOST, ("kcf-paper", "one"): WHOLE}
    (shown,) = examples(found(tmp_path, runs))
    assert shown.overlaps[0, 24] == 0
    assert shown.overlaps[0, 25] == 1


def test_the_papers_sequences_and_tracker_are_preferred(tmp_path):
    names = ("road", *PAPER_SEQUENCES)
    runs = {("siammask_e-off", name): WHOLE for name in names}
    runs |= {("siammask_e-paper", name): WHOLE for name in names}
    runs |= {("kcf-off", name): LOST for name in names}
    runs |= {("kcf-paper", name): WHOLE for name in names}
    summaries = found(tmp_path, runs, names)
    shown = examples(summaries)
    assert [each.sequence.name for each in shown] == list(PAPER_SEQUENCES)
    assert {each.tracker for each in shown} == {"siammask_e"}
    assert [each.sequence.name for each in examples(summaries, ["road"])] == ["road"]


def test_predict_is_shown_without_results_of_paper(tmp_path):
    runs = {("kcf-off", "one"): LOST, ("kcf-predict", "one"): WHOLE}
    (shown,) = examples(found(tmp_path, runs))
    assert shown.method == "predict"


def test_without_a_pair_there_is_nothing_to_draw(tmp_path):
    summaries = found(tmp_path, {("kcf-off", "one"): LOST})
    with pytest.raises(NothingToDrawError, match="both off and paper or predict results"):
        examples(summaries)
    with pytest.raises(NothingToDrawError, match="of two"):
        examples(summaries, ["two"])
