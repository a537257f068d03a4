"""Ranking and curve of EAO: points, lines, labels and colors."""

import numpy as np
import pytest
from matplotlib.colors import is_color_like, to_hex
from matplotlib.markers import MarkerStyle

from helpers.benched import write_run, write_vot_year
from ssiam.datasets import open_dataset
from ssiam.evaluation.measures.eao import INTERVALS
from ssiam.evaluation.paper.canvas import COLORS, GRAY, SMALL, NothingToDrawError
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


def assert_finished(panel):
    """A light grid below the data, two spines, and a legend beside the panel."""
    assert panel.get_axisbelow() is True
    assert {line.get_alpha() for line in panel.get_xgridlines()} == {0.25}
    assert all(line.get_visible() for line in panel.get_ygridlines())
    visible = {name: spine.get_visible() for name, spine in panel.spines.items()}
    assert visible == {"left": True, "bottom": True, "top": False, "right": False}
    legend = panel.get_legend()
    assert legend._loc == 6  # center left
    corner = panel.transAxes.inverted().transform(legend.get_bbox_to_anchor().p0)
    assert corner == pytest.approx((1.02, 0.5))
    assert not legend.get_frame_on()
    assert {text.get_fontsize() for text in legend.get_texts()} == {SMALL}


def test_the_size_and_style_of_a_ranking(found, rendered):
    for draw in (draw_ranking, draw_eao_curve):
        png = draw(found)
        assert png.startswith(b"\x89PNG")
        width, height = (int.from_bytes(png[at : at + 4], "big") for at in (16, 20))
        assert (width, height) == (8 * 130, 598)
    for figure in rendered:
        assert figure.get_size_inches() == pytest.approx([8, 4.6])
        assert type(figure.get_layout_engine()).__name__ == "ConstrainedLayoutEngine"
        assert_finished(figure.axes[0])


def test_the_gray_interval_is_behind_the_lines(found, rendered):
    draw_eao_curve(found)
    (panel,) = rendered[0].axes
    (interval,) = panel.patches
    assert to_hex(interval.get_facecolor()) == GRAY
    assert interval.get_alpha() == 0.6
    assert (interval.get_linewidth(), interval.get_zorder()) == (0, 0)
    assert {to_hex(line.get_color()) for line in panel.get_lines()} == set(COLORS[:2])
    for line in panel.get_lines():
        assert line.get_xdata()[-1] == len(line.get_ydata())


METHODS = {"off": ("--", "o"), "paper": ("-", "s"), "literal": (":", "^"), "predict": ("-.", "D")}


@pytest.fixture(scope="module")
def of_all_methods(tmp_path_factory):
    folder = tmp_path_factory.mktemp("methods")
    data = write_vot_year(folder / "VOT2018", {"one": 120})
    for method in METHODS:
        write_run(folder / "out", f"kcf-{method}", "one", "i" + "." * 119)
    write_run(folder / "out", "kcf-paper-window=9", "one", "i" + "." * 119)
    write_run(folder / "out", "mine", "one", "i" + "." * 119)
    return summarize(folder / "out", open_dataset(data))


def test_each_method_has_its_line_and_marker(of_all_methods, rendered):
    draw_eao_curve(of_all_methods)
    draw_ranking(of_all_methods)
    curves, ranking = (figure.axes[0] for figure in rendered)
    styles = {line.get_label().split()[0]: line.get_linestyle() for line in curves.get_lines()}
    expected = {f"kcf-{method}": line for method, (line, _) in METHODS.items()}
    assert styles == {**expected, "mine": "--"}, "changed settings are left out"
    points = dict(zip(legend_of(ranking), ranking.collections, strict=True))
    for method, (_, marker) in METHODS.items():
        point = points[f"kcf-{method}"]
        shape = MarkerStyle(marker)
        outline = shape.get_path().transformed(shape.get_transform())
        np.testing.assert_allclose(point.get_paths()[0].vertices, outline.vertices)
        assert point.get_sizes() == [70]
        assert point.get_linewidths() == [1.8]
    assert points["mine"].get_facecolor().size == 0


def test_a_plot_of_success_without_any_results_is_refused(tmp_path):
    data = write_vot_year(tmp_path / "clips", {"one": 20})
    write_run(tmp_path / "out", "kcf-paper-window=9", "one", "i" + "." * 19)
    with pytest.raises(NothingToDrawError, match="no tracker has results to rank"):
        draw_ranking(summarize(tmp_path / "out", open_dataset(data)))


def test_colors_repeat_after_the_last_one(tmp_path, rendered):
    data = write_vot_year(tmp_path / "clips", {"one": 20})
    for number in range(9):
        write_run(tmp_path / "out", f"tracker{number}-off", "one", "i" + "." * 19)
    draw_ranking(summarize(tmp_path / "out", open_dataset(data)))
    lines = rendered[0].axes[0].get_lines()
    assert [line.get_color() for line in lines] == [*COLORS, *COLORS[:2]]
    assert {line.get_xdata()[0] for line in lines} == {0}
    assert all("1.000" in line.get_label() or "0.9" in line.get_label() for line in lines)
