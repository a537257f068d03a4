"""Ranking and curve of EAO: points, lines, labels and colors."""

import numpy as np
import pytest
from matplotlib.colors import is_color_like, to_hex

from helpers.benched import write_run, write_vot_year
from ssiam.datasets import open_dataset
from ssiam.evaluation.measures.eao import INTERVALS
from ssiam.evaluation.paper.canvas import COLORS
from ssiam.evaluation.paper.rankings import draw_eao_curve, draw_ranking
from ssiam.evaluation.paper.summary import summarize

LOST = "i" + "." * 89 + "x----i" + "." * 104
WHOLE = "i" + "." * 199
LABELS = ["csrt-off", "kcf-off", "kcf-paper"]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """One sequence: kcf alone loses its target once and is shifted, the others are exact."""
    folder = tmp_path_factory.mktemp("ranked")
    data = write_vot_year(folder / "VOT2018", {"one": 200})
    write_run(folder / "out", "csrt-off", "one", WHOLE)
    write_run(folder / "out", "kcf-off", "one", LOST, 3.0)
    write_run(folder / "out", "kcf-paper", "one", WHOLE)
    return summarize(folder / "out", open_dataset(data))


def legend_of(panel):
    return [text.get_text() for text in panel.get_legend().get_texts()]


def test_colors_are_valid_and_differ():
    assert all(map(is_color_like, COLORS))
    assert len({to_hex(color) for color in COLORS}) == len(COLORS)


def test_accuracy_and_robustness_are_points_in_the_trackers_color(found, rendered):
    draw_ranking(found)
    (panel,) = rendered[0].axes
    assert sorted(legend_of(panel)) == LABELS
    points = dict(zip(legend_of(panel), panel.collections, strict=True))
    xy = {label: point.get_offsets()[0] for label, point in points.items()}
    robustness, accuracy = xy["kcf-off"]
    assert robustness == pytest.approx(np.exp(-30 / 200), abs=0.01)  # one loss in 200 frames
    for label in ("csrt-off", "kcf-paper"):
        assert xy[label][0] == 1
        assert 1 >= xy[label][1] > accuracy + 0.05
    edges = {label: to_hex(point.get_edgecolor()[0]) for label, point in points.items()}
    assert edges["kcf-off"] == edges["kcf-paper"] != edges["csrt-off"]
    assert {edges["kcf-off"], edges["csrt-off"]} == set(COLORS[:2])
    filled = {label: len(point.get_facecolor()) > 0 for label, point in points.items()}
    assert filled == {"csrt-off": False, "kcf-off": False, "kcf-paper": True}
    assert panel.get_xlabel() == "robustness: share of targets still tracked after 30 frames"
    assert panel.get_ylabel() == "accuracy: mean overlap"


def test_the_curve_of_eao_has_the_interval_and_a_line_for_each_tracker(found, rendered):
    draw_eao_curve(found)
    (panel,) = rendered[0].axes
    low, high = INTERVALS[2018]
    (interval,) = panel.patches
    assert (interval.get_x(), interval.get_x() + interval.get_width()) == (low, high)
    by_label = {each.label: each for each in found.entries}
    lines = {line.get_label().split()[0]: line for line in panel.get_lines()}
    assert sorted(lines) == LABELS
    for label, line in lines.items():
        assert line.get_ydata() == pytest.approx(by_label[label].eao_curve)
        assert line.get_xdata()[0] == 1
        assert line.get_label().split()[1] == f"{by_label[label].scores.eao:.3f}"
    assert [lines[label].get_linestyle() for label in LABELS] == ["--", "--", "-"]
    assert panel.get_xlabel() == "frames from the start"
    assert panel.get_ylabel() == "expected average overlap"
    assert panel.get_ylim() == (0, 1)
    assert panel.get_xlim()[0] == 1


def test_other_datasets_have_a_success_plot_with_a_line_for_each_tracker(tmp_path, rendered):
    data = write_vot_year(tmp_path / "clips", {"one": 40})
    write_run(tmp_path / "out", "kcf-off", "one", "i" + "." * 39, 10.0)
    write_run(tmp_path / "out", "kcf-paper", "one", "i" + "." * 39)
    draw_ranking(summarize(tmp_path / "out", open_dataset(data)))
    (panel,) = rendered[0].axes
    lines = {line.get_label().split()[0]: line for line in panel.get_lines()}
    assert {name: line.get_linestyle() for name, line in lines.items()} == {
        "kcf-off": "--",
        "kcf-paper": "-",
    }
    assert lines["kcf-off"].get_color() == lines["kcf-paper"].get_color() == COLORS[0]
    assert lines["kcf-paper"].get_ydata().mean() > lines["kcf-off"].get_ydata().mean() + 0.1
    assert (panel.get_xlim(), panel.get_ylim()) == ((0, 1), (0, 1))
    assert panel.get_xlabel() == "overlap threshold"
    assert panel.get_ylabel() == "share of frames, supervised runs"
