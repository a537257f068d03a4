"""Panels and rows of examples: which part of a frame they show, and how they look."""

import cv2
import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba

from helpers.benched import write_run, write_vot_year
from helpers.paper_examples import example
from ssiam.datasets import VideoSequence, open_dataset
from ssiam.evaluation.paper.canvas import SMALL, canvas
from ssiam.evaluation.paper.qualitative import (
    Example,
    _panel_bounds,
    draw_boxes,
    example_of,
    largest_difference,
    outline_region,
)
from ssiam.evaluation.paper.strips import Strip, draw_strips, failures, results
from ssiam.evaluation.paper.summary import summarize

FRAME = np.zeros((600, 1000, 3), np.uint8)


def bounds(x, y, w, h, frame=FRAME):
    return _panel_bounds(frame, np.array([x, y, w, h], float))


def test_a_panel_shows_six_target_heights():
    left, top, right, bottom = bounds(480, 270, 40, 60)
    assert (right - left, bottom - top) == (480, 360)
    assert (left + right) / 2 == 500
    assert (top + bottom) / 2 == 300


def test_a_wide_target_decides_by_its_width():
    left, top, right, bottom = bounds(452, 290, 96, 20)  # as high as 72 px
    assert (right - left, bottom - top) == (576, 432)


def test_a_small_target_is_shown_in_160_pixels():
    left, top, right, bottom = bounds(495, 295, 10, 10)
    assert (right - left, bottom - top) == (213, 160)


def test_a_panel_is_not_larger_than_the_frame():
    assert bounds(400, 200, 200, 200) == (100, 0, 900, 600)
    narrow = np.zeros((600, 400, 3), np.uint8)
    left, top, right, bottom = bounds(150, 250, 100, 100, narrow)
    assert (left, right) == (0, 400)
    assert (top, bottom) == (150, 450)


def test_a_panel_stays_inside_of_the_frame():
    assert bounds(0, 0, 10, 10)[:2] == (0, 0)
    left, top, right, bottom = bounds(990, 590, 10, 10)
    assert left == 787  # the panel is 213.3 px wide
    assert (top, bottom) == (440, 600)
    assert right == 1000


@pytest.mark.parametrize("hidden", range(4))
def test_without_a_target_the_whole_frame_is_shown(hidden):
    xywh = np.array([480.0, 270, 40, 60])
    xywh[hidden] = np.nan
    assert _panel_bounds(FRAME, xywh) == (0, 0, 1000, 600)


def test_frames_are_a_fifteenth_apart_and_at_most_six():
    off = np.zeros(90)
    found = example(off, np.full(90, 0.5))
    assert found.frames == [0, 6, 12, 18, 24, 30]
    stabilized = np.zeros(90)
    stabilized[[10, 15, 16]] = 0.9, 0.8, 0.7
    assert example(off, stabilized).frames == [10, 16]


@pytest.mark.parametrize("count", [14, 15, 16])
def test_frames_of_a_short_sequence(count):
    found = example(np.zeros(count), np.linspace(0.9, 0.1, count)).frames
    assert found == list(range(6)) if count <= 15 else list(range(0, 12, 2))


def test_an_example_is_that_of_paper_by_default():
    assert example(np.ones(3), np.ones(3)).method == "paper"


def written(tmp_path, runs):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 40, "two": 40})
    for (label, name), (codes, shift) in runs.items():
        write_run(tmp_path / "out", label, name, codes, shift)
    return summarize(tmp_path / "out", open_dataset(data))


WHOLE, LOST = "i" + "." * 39, "i" + "." * 19 + "x----i" + "." * 14


def test_among_equal_losses_the_overlap_decides(tmp_path):
    found = written(
        tmp_path,
        {
            ("kcf-off", "one"): (WHOLE, 0.0),
            ("kcf-paper", "one"): (WHOLE, 1.0),
            ("kcf-off", "two"): (WHOLE, 4.0),
            ("kcf-paper", "two"): (WHOLE, 0.0),
        },
    )
    chosen = largest_difference(found)
    assert (chosen.sequence.name, chosen.tracker, chosen.one_pass) == ("two", "kcf", False)
    assert chosen.method == "paper"


def test_a_tracker_that_got_worse_has_a_difference_too(tmp_path):
    found = written(
        tmp_path,
        {
            ("kcf-off", "one"): (WHOLE, 3.0),
            ("kcf-paper", "one"): (WHOLE, 0.0),
            ("kcf-off", "two"): (WHOLE, 0.0),
            ("kcf-paper", "two"): (LOST, 0.0),
        },
    )
    assert largest_difference(found).sequence.name == "two"


def test_only_paper_is_compared_with_off(tmp_path):
    found = written(
        tmp_path, {("kcf-off", "one"): (WHOLE, 3.0), ("kcf-predict", "one"): (WHOLE, 0.0)}
    )
    assert largest_difference(found) is None


def test_an_example_needs_both_runs_and_has_the_frames_of_both(tmp_path):
    found = written(
        tmp_path,
        {
            ("kcf-off", "one"): ("i" + "." * 19, 2.0),
            ("kcf-paper", "one"): (LOST, 0.0),
            ("kcf-off", "two"): (WHOLE, 0.0),
        },
    )
    off, paper = found.entries
    assert example_of("two", off, paper) is None
    assert example_of("two", paper, off) is None
    assert example_of("three", off, paper) is None
    both = example_of("one", off, paper)
    assert len(both.truth) == len(both.off) == len(both.stabilized) == 20
    np.testing.assert_array_equal(both.off[0, :4], both.truth[0, :4])  # a start
    assert both.overlaps[0, 0] == 1
    assert both.overlaps[0, 1] < 1


def panel_of(size=(4.0, 3.0)):
    return canvas(size, (1, 1))[1][0, 0]


def test_a_region_has_a_dark_rim():
    panel = panel_of()
    outline_region(panel, np.array([10.0, 20, 30, 40]), "#ff0000", "--", 2.0)
    (patch,) = panel.patches
    assert patch.get_xy()[:4].tolist() == [[10, 20], [40, 20], [40, 60], [10, 60]]
    assert not patch.get_fill()
    assert to_hex(patch.get_edgecolor()) == "#ff0000"
    assert (patch.get_linewidth(), patch.get_linestyle()) == (2.0, "--")
    rim, line = patch.get_path_effects()
    assert rim._gc == {"linewidth": 3.4, "foreground": "#000000a0"}
    assert type(line).__name__ == "Normal"


def test_lines_of_regions_are_solid_and_thin_by_default():
    panel = panel_of()
    outline_region(panel, np.array([10.0, 20, 30, 40]), "#ff0000")
    (patch,) = panel.patches
    assert (patch.get_linewidth(), patch.get_linestyle()) == (1.8, "-")


def test_a_missing_region_is_not_drawn():
    panel = panel_of()
    outline_region(panel, np.full(4, np.nan), "#ff0000")
    outline_region(panel, np.full(8, np.nan), "#ff0000")
    assert not panel.patches
    outline_region(panel, np.array([1.0, 1, 9, 1, 9, 5, 1, 6]), "#ff0000")
    assert panel.patches[0].get_xy()[:4].tolist() == [[1, 1], [9, 1], [9, 5], [1, 6]]


@pytest.fixture
def images(tmp_path):
    for index in range(40):
        frame = np.full((48, 64, 3), (6 * index, 0, 200), np.uint8)
        cv2.imwrite(str(tmp_path / f"{index:02}.png"), frame)
    return tuple(sorted(tmp_path.glob("*.png")))


def with_frames(count, images):
    """An example that differs in `count` frames."""
    stabilized = np.full(40, 0.5)
    stabilized[np.arange(count) * 4] = np.linspace(0.9, 0.8, count) if count else []
    return example(np.full(40, 0.5), stabilized, "s", images)


@pytest.mark.parametrize(
    ("count", "columns", "rows"), [(1, 1, 1), (2, 2, 1), (3, 3, 1), (4, 3, 2), (6, 3, 2)]
)
def test_panels_of_boxes_are_in_rows_of_three(images, rendered, count, columns, rows):
    draw_boxes(with_frames(count, images))
    (figure,) = rendered
    assert figure.get_size_inches() == pytest.approx([3.4 * columns, 2.85 * rows + 0.4])
    assert len(figure.axes) == columns * rows
    shown = [panel for panel in figure.axes if panel.get_images()]
    assert len(shown) == count
    assert not any(panel.axison for panel in figure.axes)
    titles = [panel.get_title() for panel in shown]
    assert [title.split(":")[0] for title in titles] == [f"frame {4 * n}" for n in range(count)]
    assert shown[0].title.get_fontsize() == SMALL
    red, green, blue = shown[-1].get_images()[0].get_array()[0, 0]
    assert (red, green, blue) == (200, 0, 6 * 4 * (count - 1))


def test_boxes_have_their_colors_and_lines(images, rendered):
    draw_boxes(with_frames(1, images))
    (figure,) = rendered
    truth, off, stabilized = figure.axes[0].patches
    colors = [to_hex(each.get_edgecolor()) for each in (truth, off, stabilized)]
    assert colors == ["#ffffff", "#ff9d3c", "#56d4ff"]
    assert truth.get_linestyle() == stabilized.get_linestyle() == "-"
    assert off.get_linestyle() == (0, (3, 1.5)) or off.get_linestyle() == "--"
    (legend,) = figure.legends
    handles = legend.legend_handles
    assert [to_hex(each.get_color()) for each in handles] == colors
    assert {each.get_linewidth() for each in handles} == {2}
    assert [each.is_dashed() for each in handles] == [False, True, False]
    assert_legend(legend, 3)


def assert_legend(legend, columns):
    assert legend._ncols == columns
    assert legend._loc == 8  # lower center
    assert legend._outside_loc == "lower"
    assert to_rgba(legend.get_frame().get_facecolor(), 1) == to_rgba("#404040")
    for text in legend.get_texts():
        assert text.get_fontsize() == SMALL
        assert to_hex(text.get_color()) == "#ffffff"


def lost_in(images, frame, name="s"):
    off = np.ones(40)
    off[frame] = 0
    return example(off, np.full(40, 0.5), name, images)


def test_a_loss_needs_four_frames_before_it():
    images = ()
    assert failures([lost_in(images, 4)])[0].frames == (0, 1, 2, 3, 4)
    off = np.ones(40)
    off[[3, 9]] = 0
    assert failures([example(off, off)])[0].frames == (0, 6, 7, 8, 9)


def test_unknown_truth_is_no_loss():
    found = lost_in((), 9)
    found.truth[9] = np.nan
    with pytest.raises(Exception, match="lost no target"):
        failures([found])


def test_the_number_of_rows_is_limited():
    lost = [lost_in((), 9)] * 6
    assert [len(failures(lost)), len(failures(lost, limit=False))] == [3, 6]
    assert [len(results(lost)), len(results(lost, limit=False))] == [4, 6]


def test_output_frames_are_a_fifteenth_of_the_sequence_apart():
    off, stabilized = np.full(90, 0.5), np.full(90, 0.5)
    stabilized[[4, 6, 12, 17, 40]] = 0.9, 0.8, 0.7, 0.65, 0.6
    (strip,) = results([example(off, stabilized)])
    assert strip.frames == (0, 6, 12, 40, 89)


def test_output_frames_without_a_gain_are_spread():
    (strip,) = results([example(np.full(80, 0.5), np.full(80, 0.5))])
    assert strip.frames == (0, 49, 59, 69, 79)


def test_the_first_frame_of_equal_gains_is_shown():
    off, stabilized = np.full(90, 0.5), np.full(90, 0.5)
    stabilized[20:24] = stabilized[60] = 0.9
    (strip,) = results([example(off, stabilized)])
    assert strip.frames[:2] == (0, 20)


def test_the_layout_of_strips(images, rendered):
    strips = [
        Strip(lost_in(images, 9, "road"), (0, 6, 7, 8, 9)),
        Strip(lost_in(images, 9, "lake"), (0, 7, 8)),
    ]
    draw_strips(strips, stabilized=True)
    (figure,) = rendered
    ratio = 48 / 64
    assert figure.get_size_inches() == pytest.approx([2.6 * 5 + 0.3, 2.6 * 2 * ratio + 0.7])
    panels = np.array(figure.axes).reshape(2, 5)
    assert [panel.get_ylabel() for panel in panels[:, 0]] == ["road", "lake"]
    assert {panel.yaxis.label.get_fontsize() for panel in panels[:, 0]} == {SMALL + 2}
    assert {panels[0, n].title.get_fontsize() for n in (0, 2)} == {SMALL + 2}
    assert [bool(panel.get_images()) for panel in panels[1]] == [True] * 3 + [False] * 2
    for panel in panels.flat:
        assert not len(panel.get_xticks())
        assert not len(panel.get_yticks())
        assert not any(spine.get_visible() for spine in panel.spines.values())
    red, green, blue = panels[0, 2].get_images()[0].get_array()[0, 0]
    assert (red, green, blue) == (200, 0, 42)
    widths = {
        to_hex(patch.get_edgecolor()): patch.get_linewidth() for patch in panels[0, 2].patches
    }
    assert widths == {"#1ee65a": 3.6, "#ffe11a": 1.8, "#3c8cff": 1.8}
    (legend,) = figure.legends
    assert_legend(legend, 3)
    handles = legend.legend_handles
    assert [to_hex(each.get_color()) for each in handles] == ["#ffe11a", "#3c8cff", "#1ee65a"]
    assert {each.get_linewidth() for each in handles} == {2.5}


def test_rows_of_strips_are_as_high_as_their_frames(tmp_path, images, rendered):
    cv2.imwrite(str(tmp_path / "wide.png"), np.zeros((16, 64, 3), np.uint8))
    wide = lost_in((tmp_path / "wide.png",) * 40, 9)
    strips = [Strip(lost_in(images, 9), (0, 7)), Strip(wide, (0, 7))]
    draw_strips(strips, stabilized=False)
    (figure,) = rendered
    assert figure.get_size_inches() == pytest.approx([2.6 * 2 + 0.3, 2.6 * (0.75 + 0.25) + 0.7])
    grid = figure.axes[0].get_gridspec()
    assert list(grid.get_height_ratios()) == [0.75, 0.25]


def test_labels_of_strips(images, rendered):
    stabilized = np.ones(40)
    stabilized[9] = 0
    both = example(stabilized, stabilized, "road", images)
    draw_strips([Strip(both, (0, 6, 7, 8, 9))], stabilized=True)
    (figure,) = rendered
    last = figure.axes[4]
    texts = {text.get_text(): text for text in last.texts}
    assert list(texts) == ["frame 9", "off: lost", "paper: lost"]
    positions = {name: text.get_position() for name, text in texts.items()}
    assert positions["frame 9"] == pytest.approx((0.02, 0.97))
    assert positions["off: lost"] == pytest.approx((0.98, 0.97))
    assert positions["paper: lost"] == pytest.approx((0.98, 0.84))
    colors = [text.get_color() for text in texts.values()]
    assert colors == ["white", "#ffe11a", "#3c8cff"]
    for text in texts.values():
        assert text.get_fontsize() == SMALL - 1
        assert text.get_va() == "top"
        assert text.get_transform() == last.transAxes
        box = text.get_bbox_patch()
        assert to_hex(box.get_facecolor(), keep_alpha=True) == "#000000a0"
        assert box.get_edgecolor() == (0, 0, 0, 0)
        assert box.get_boxstyle().pad == pytest.approx(1.5 / (SMALL - 1), abs=0.01)


def test_the_line_at_the_targets_height_is_thin_and_dashed(images, rendered):
    found = lost_in(images, 9)
    found.truth[6] = 10, 4, 20, 30
    draw_strips([Strip(found, (0, 6, 7, 8, 9))], stabilized=False)
    (figure,) = rendered
    assert not figure.axes[0].get_lines()
    for panel in figure.axes[1:]:
        (line,) = panel.get_lines()
        assert line.get_ydata() == [19, 19]
        assert to_hex(line.get_color()) == "#1ee65a"
        assert line.is_dashed()
        assert line.get_linewidth() == 1
    (legend,) = figure.legends
    assert legend._ncols == 2


def test_a_polygon_is_drawn_as_one(images, rendered):
    truth = np.tile([10.0, 10, 30, 12, 30, 30, 10, 28], (40, 1))
    polygons = Example("kcf", VideoSequence("s", images, truth), True, truth, truth, truth)
    draw_strips([Strip(polygons, (0, 7))], stabilized=False)
    (figure,) = rendered
    first = figure.axes[0].patches[0].get_xy()[:4]
    assert first.tolist() == [[10, 10], [30, 12], [30, 30], [10, 28]]
