"""Strips: which sequences and frames they show."""

import cv2
import numpy as np
import pytest
from matplotlib.colors import to_hex

from helpers.benched import write_run, write_vot_year
from helpers.paper_examples import example
from ssiam.datasets import open_dataset
from ssiam.evaluation.paper.canvas import NothingToDrawError
from ssiam.evaluation.paper.strips import (
    PAPER_SEQUENCES,
    draw_strips,
    examples,
    failures,
    gain,
    results,
)
from ssiam.evaluation.paper.summary import summarize

LOST = "i" + "." * 19 + "x----i" + "." * 14
WHOLE = "i" + "." * 39


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


def test_without_gains_the_row_is_filled_up_to_the_last_frame():
    (strip,) = results([example(np.ones(90), np.ones(90))])
    assert len(strip.frames) == 5
    assert (strip.frames[0], strip.frames[-1]) == (0, 89)
    assert min(np.diff(strip.frames)) >= 6


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


def colors(patches):
    return [to_hex(patch.get_edgecolor()) for patch in patches]


@pytest.mark.parametrize("stabilized", [False, True])
def test_drawn_strips(stabilized, tmp_path, rendered):
    """Boxes, labels, titles and the legend of a sequence whose target is lost in frame 9."""
    for index in range(10):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.full((48, 64, 3), 20 * index, np.uint8))
    images = tuple(sorted(tmp_path.glob("*.png")))
    off, on = np.ones(10), np.full(10, 0.5)
    off[9] = 0
    lost = example(off, on, "road", images)
    draw_strips(failures([lost]), stabilized=stabilized)
    (figure,) = rendered
    panels = figure.axes
    shown = [int(panel.get_images()[0].get_array().mean()) // 20 for panel in panels]
    assert shown == [0, 6, 7, 8, 9]
    for panel, index in zip(panels, shown, strict=True):
        assert panel.get_xlim() == (-0.5, 63.5)
        assert panel.get_ylim() == (47.5, -0.5)
        assert panel.texts[0].get_text() == f"frame {index}"
        assert panel.texts[0].get_ha() == "left"
        lines = [line.get_ydata()[0] for line in panel.get_lines()]
        assert lines == ([20] if index and not stabilized else [])
    yellow, blue, green = "#ffe11a", "#3c8cff", "#1ee65a"
    blues = [blue] if stabilized else []
    assert [colors(panel.patches) for panel in panels] == [
        [green],
        *[[green, yellow, *blues]] * 3,
        [green, *blues],
    ]
    notes = [[text.get_text() for text in panel.texts[1:]] for panel in panels]
    assert notes == [[]] * 4 + [["off: lost"]]
    assert panels[4].texts[1].get_ha() == "right"
    assert panels[0].get_ylabel() == "road"
    middle = "output" if stabilized else "the frames up to the loss"
    assert [panel.get_title() for panel in panels] == ["first frame", "", middle, "", ""]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "kcf alone",
        *(["kcf stabilized (paper)"] if stabilized else []),
        "truth",
    ]
