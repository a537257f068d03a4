"""Figures: the data behind them, and the images."""

import cv2
import numpy as np
import pytest
from matplotlib.colors import to_hex

from helpers.benched import bench, write_run, write_vot_year
from helpers.paper_examples import example
from helpers.shaky_dataset import write_dataset
from helpers.synthetic import camera_frame, generator, poses, world
from ssiam.datasets import VideoSequence, open_dataset
from ssiam.errors import MissingExtraError
from ssiam.evaluation.measures.eao import INTERVALS
from ssiam.evaluation.paper import camera_figures
from ssiam.evaluation.paper.camera_figures import (
    CameraRecord,
    draw_correction,
    draw_path,
    draw_transformed,
    most_moved,
    record_camera,
)
from ssiam.evaluation.paper.canvas import BLUE as INK
from ssiam.evaluation.paper.canvas import GRAY, ORANGE
from ssiam.evaluation.paper.canvas import GREEN as TEAL
from ssiam.evaluation.paper.figures import figures
from ssiam.evaluation.paper.qualitative import Example, draw_boxes, largest_difference
from ssiam.evaluation.paper.summary import summarize
from ssiam.evaluation.runs.entries import Entry
from ssiam.geometry import rigid
from ssiam.motion import Motion
from ssiam.stabilize import StabilizerConfig

PAPER = StabilizerConfig("paper")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    data = write_dataset(tmp_path_factory.mktemp("tiny"))
    out = tmp_path_factory.mktemp("out")
    bench(data, out, [Entry("kcf", StabilizerConfig("off")), Entry("kcf", PAPER)])
    return summarize(out, open_dataset(data))


def decoded(png):
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)


def pixels(png, color, tolerance=12):
    """How many pixels have a color given as #rrggbb."""
    bgr = [int(color[index : index + 2], 16) for index in (5, 3, 1)]
    return int((np.abs(decoded(png).astype(int) - bgr).max(axis=2) <= tolerance).sum())


YELLOW, BLUE, GREEN = "#ffe11a", "#3c8cff", "#1ee65a"


def test_all_figures_are_drawn(found):
    drawn, notes = figures(found)
    assert notes == []
    names = "fig1", "fig3", "fig4", "fig5", "fig6", "boxes", "ranking", "eao"
    assert tuple(each.name.partition("-")[0] for each in drawn) == names
    titles = {each.name.partition("-")[0]: each.title for each in drawn}
    assert titles["fig1"] == "Fig. 1: where kcf alone loses its target"
    assert titles["fig6"] == "Fig. 6: kcf alone and stabilized"
    for number in (3, 4, 5):
        assert titles[f"fig{number}"].startswith(f"Fig. {number}: ")
    for each in drawn:
        assert each.caption.endswith(".")
        assert decoded(each.png).std() > 10
        assert min(decoded(each.png).shape[:2]) > 300


def test_figure_1_has_no_stabilized_box_and_figure_6_has_all_three(found):
    by_name = {each.name.partition("-")[0]: each.png for each in figures(found)[0]}
    for color in (YELLOW, GREEN):
        assert pixels(by_name["fig1"], color) > 100
        assert pixels(by_name["fig6"], color) > 100
    # The frames themselves have some pixels of each color.
    assert pixels(by_name["fig6"], BLUE) > 4 * pixels(by_name["fig1"], BLUE)


def test_chosen_sequences(found):
    drawn, notes = figures(found, ["clip2"])
    by_name = {each.name.partition("-")[0]: each for each in drawn}
    assert "clip2" in by_name["fig3"].title
    assert "clip2" in by_name["fig5"].title
    one, all_three = (decoded(each["fig6"].png) for each in (by_name, named_figures(found)))
    assert len(one) < 0.6 * len(all_three)
    drawn, notes = figures(found, ["elsewhere"])
    assert [each.name.partition("-")[0] for each in drawn] == ["boxes", "ranking", "eao"]
    assert all("elsewhere" in note for note in notes)


def named_figures(found):
    return {each.name.partition("-")[0]: each for each in figures(found)[0]}


@pytest.fixture(scope="module")
def shaking(tmp_path_factory):
    """A sequence of 20 frames, and its poses relative to the first one."""
    folder, size = tmp_path_factory.mktemp("shaking"), (320, 240)
    shifts = generator(5).normal(0, (3, 2, 0.004), (20, 3)).cumsum(axis=0)
    for index, pose in enumerate(poses(shifts, size)):
        cv2.imwrite(str(folder / f"{index:02}.png"), camera_frame(world(1, size), pose))
    images = tuple(sorted(folder.glob("*.png")))
    return VideoSequence("s", images, np.full((20, 4), np.nan)), shifts - shifts[0]


def test_the_camera_of_a_known_motion(shaking):
    sequence, shifts = shaking
    record = record_camera(sequence, PAPER)
    assert record.reliable.all()
    assert np.abs(record.path - shifts)[:, :2].max() < 1
    assert np.abs(record.path - shifts)[:, 2].max() < 0.003
    means = np.array([record.path[: index + 1].mean(axis=0) for index in range(20)])
    assert np.abs(record.smooth - means)[:, :2].max() < 0.2
    assert record.new_trans == pytest.approx(record.smooth - record.path)


def test_figure_4_has_a_line_for_each_part_of_the_correction(shaking):
    png = draw_correction(record_camera(shaking[0], PAPER))
    assert all(pixels(png, color) > 100 for color in ("#0072b2", "#d55e00", "#009e73"))


def test_figure_5_shows_the_frame_that_moved_farthest_with_black_borders(shaking):
    sequence, _ = shaking
    record = record_camera(sequence, PAPER)
    index = most_moved(record, (320, 240))
    shifts = np.linalg.norm(record.new_trans[:, :2], axis=1)
    assert shifts[index] > 0.8 * shifts.max()
    image = decoded(draw_transformed(sequence, record, index, 20))
    black = image.max(axis=2) < 8
    left, right = np.hsplit(black[:, : black.shape[1] // 2 * 2], 2)
    assert left.mean() < 0.06
    assert right.mean() > left.mean() + 0.1  # 24 % of the transformed frame are its border


def test_frames_with_the_largest_differences_are_sorted_and_apart():
    stabilized = np.full(90, 0.9)
    stabilized[[7, 8, 40, 41, 80]] = 0.1, 0.0, 0.2, 0.25, 0.8
    found = example(np.full(90, 0.9), stabilized)
    assert found.frames == [8, 40, 80]
    assert found.overlaps[:, 8] == pytest.approx([0.9, 0])


def test_no_frames_without_a_difference():
    assert example(np.full(9, 0.5), np.full(9, 0.5)).frames == []


def test_the_example_has_the_largest_difference_of_lost_targets(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 40, "two": 40})
    for label, loses in (("kcf-off", "two"), ("kcf-paper", "")):
        for name in ("one", "two"):
            codes = "i" + "." * 19 + ("x----i" if name == loses else "......") + "." * 14
            write_run(tmp_path / "out", label, name, codes)
    found = summarize(tmp_path / "out", open_dataset(data))
    assert largest_difference(found).sequence.name == "two"


def test_a_figure_without_frames_or_pairs_becomes_a_note(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 120})
    write_run(tmp_path / "out", "kcf-off", "one", "i" + "." * 119)
    drawn, notes = figures(summarize(tmp_path / "out", open_dataset(data)))
    assert [each.name for each in drawn] == ["ranking-VOT2018", "eao-VOT2018"]
    assert all(decoded(each.png).std() > 5 for each in drawn)
    assert [note.partition(":")[2].partition(":")[0].strip() for note in notes] == [
        "no figure 1",
        "no figures 3 to 5",
        "no figure 6",
        "no figure of boxes",
    ]
    assert "00000002.jpg" in notes[1]


def test_the_mean_of_the_curve_over_the_interval_is_eao(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 200, "two": 150})
    write_run(tmp_path / "out", "kcf-off", "one", "i" + "." * 89 + "x----i" + "." * 104, 3.0)
    write_run(tmp_path / "out", "kcf-off", "two", "i" + "." * 149)
    (entry,) = summarize(tmp_path / "out", open_dataset(data)).entries
    low, high = INTERVALS[2018]
    assert 0 < entry.scores.eao < 1
    assert entry.eao_curve[low - 1 : high].mean() == pytest.approx(entry.scores.eao)


def test_the_ranking_needs_an_entry_with_default_settings(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 20})
    write_run(tmp_path / "out", "kcf-paper-tha=0.5", "one", "i" + "." * 19)
    drawn, notes = figures(summarize(tmp_path / "out", open_dataset(data)))
    assert drawn == []
    assert "no ranking" in notes[-2]
    assert "no curve of EAO" in notes[-1]


def test_missing_matplotlib_names_the_extra(found, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"ssiam\[bench\]"):
        figures(found)


def legend_of(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_axes_and_lines_of_figure_3_are_labeled(shaking, rendered):
    draw_path(record_camera(shaking[0], PAPER))
    x, y = rendered[0].axes
    assert (x.get_ylabel(), y.get_ylabel()) == ("x  (px, right)", "y  (px, down)")
    assert (x.get_xlabel(), y.get_xlabel()) == ("", "frame")
    assert legend_of(x) == ["accumulated", "smoothed"]
    assert not x.get_legend().get_frame_on()


def test_axes_and_lines_of_figure_4_are_labeled(shaking, rendered):
    record = record_camera(shaking[0], PAPER)
    draw_correction(record)
    shifts, angles = rendered[0].axes
    assert shifts.get_xlabel() == "frame"
    assert shifts.get_ylabel() == "dx, dy  (px, right and down)"
    assert angles.get_ylabel() == "da  (degrees, clockwise)"
    assert legend_of(shifts) == ["dx", "dy", "da (right scale)"]
    drawn = [*shifts.get_lines(), *angles.get_lines()]
    dx, dy, da = record.new_trans.T
    for line, values in zip(drawn, (dx, dy, np.degrees(da)), strict=True):
        assert line.get_ydata() == pytest.approx(values)
        assert line.get_linewidth() == 1.2
    for axes in (shifts, angles):  # zero in the middle
        low, high = axes.get_ylim()
        assert low == -high


def test_figure_5_has_the_frame_and_the_transformed_one_at_the_same_scale(shaking, rendered):
    sequence, _ = shaking
    record = record_camera(sequence, PAPER)
    draw_transformed(sequence, record, most_moved(record, (320, 240)), 20)
    panels = rendered[0].axes
    assert [panel.get_title() for panel in panels] == ["original", "transformed"]
    sizes = [panel.get_images()[0].get_array().shape[:2] for panel in panels]
    assert sizes == [(240, 320), (280, 360)]
    widths = [panel.get_window_extent().width for panel in panels]
    assert widths[1] / widths[0] == pytest.approx(360 / 320, rel=0.02)
    assert all(not panel.axison for panel in panels)


def test_titles_name_the_figure_and_the_sequence_or_tracker(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 40, "two": 40})
    for label in ("kcf-off", "kcf-paper"):
        for name in ("one", "two"):
            write_run(tmp_path / "out", label, name, "i" + "." * 39)
    drawn, _ = figures(summarize(tmp_path / "out", open_dataset(data)))
    titles = {each.name: each.title for each in drawn}
    assert titles["ranking-VOT2018"] == "Ranking: accuracy and robustness on VOT2018"
    assert titles["eao-VOT2018"] == "Expected average overlap on VOT2018"


@pytest.fixture
def filmed_example(tmp_path):
    """An example with images of 400 x 300 px, whose tracker alone is beside the target."""
    for index in range(40):
        cv2.imwrite(str(tmp_path / f"{index:02}.png"), world(index, (400, 300)))
    truth = np.tile([200.0, 150, 30, 20], (40, 1))
    stabilized = np.tile([205.0, 150, 30, 20], (40, 1))
    off = np.where(np.arange(40)[:, None] == 20, [230.0, 180, 30, 20], stabilized)
    images = tuple(sorted(tmp_path.glob("*.png")))
    return Example("kcf", VideoSequence("s", images, truth), False, truth, off, stabilized)


def test_boxes_are_drawn_in_a_window_around_the_target(filmed_example, rendered):
    draw_boxes(filmed_example)
    (figure,) = rendered
    (panel,) = figure.axes
    assert panel.get_title() == "frame 20: off 0.00, stabilized 0.71"
    assert not panel.axison
    left, right = panel.get_xlim()
    bottom, top = panel.get_ylim()
    assert (left + right) / 2 == pytest.approx(215, abs=1)  # the target's center
    assert (top + bottom) / 2 == pytest.approx(160, abs=1)
    assert right - left == pytest.approx(4 / 3 * 160, abs=1)
    assert bottom - top == pytest.approx(160, abs=1)
    image = world(20, (400, 300))[round(top + 0.5) : round(bottom + 0.5), :, ::-1]
    image = image[:, round(left + 0.5) : round(right + 0.5)]
    assert (panel.get_images()[0].get_array() == image).all()
    corners = [patch.get_xy()[:4].tolist() for patch in panel.patches]
    assert [corner[0] for corner in corners] == [[200, 150], [230, 180], [205, 150]]
    assert [corner[2] for corner in corners] == [[230, 170], [260, 200], [235, 170]]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["truth", "off", "stabilized"]


def known_camera(count=8):
    """A record with given numbers; the motion to frames 2 and 5 is unknown."""
    steps = np.arange(count, dtype=float)
    path = np.stack([steps, -2 * steps, 0.01 * steps], axis=1)
    smooth = path / 2
    reliable = np.ones(count, bool)
    reliable[[2, 5]] = False
    transforms = np.tile(np.eye(3), (count, 1, 1))
    transforms[:, :2, 2] = (smooth - path)[:, :2]
    return CameraRecord(path, smooth, smooth - path, transforms, reliable)


def test_lines_and_unreliable_frames_of_figure_3(rendered):
    record = known_camera()
    draw_path(record)
    (figure,) = rendered
    assert figure.get_size_inches().tolist() == [9, 5]
    for column, panel in enumerate(figure.axes):
        accumulated, smoothed = panel.get_lines()
        np.testing.assert_array_equal(accumulated.get_ydata(), record.path[:, column])
        np.testing.assert_array_equal(smoothed.get_ydata(), record.smooth[:, column])
        assert [to_hex(line.get_color()) for line in (accumulated, smoothed)] == [ORANGE, INK]
        assert accumulated.get_linewidth() < smoothed.get_linewidth()
        bands = [(each.get_x(), each.get_width()) for each in panel.patches]
        assert bands == [(1.5, 1), (4.5, 1)]
        assert {to_hex(each.get_facecolor()) for each in panel.patches} == {GRAY}
        assert {each.get_linewidth() for each in panel.patches} == {0}
        assert {each.get_zorder() for each in panel.patches} == {0}
        assert not panel.spines["top"].get_visible()
        assert not panel.spines["right"].get_visible()
        assert panel.spines["left"].get_visible()
    assert figure.axes[1].get_legend() is None
    assert figure.axes[0].get_shared_x_axes().joined(*figure.axes)


def test_lines_of_figure_4_have_their_colors_and_symmetric_scales(rendered):
    record = known_camera()
    draw_correction(record)
    (figure,) = rendered
    shifts, angles = figure.axes
    assert figure.get_size_inches() == pytest.approx([9, 3.6])
    colors = [to_hex(line.get_color()) for line in (*shifts.get_lines(), *angles.get_lines())]
    assert colors == [INK, ORANGE, TEAL]
    assert shifts.get_ylim() == pytest.approx((-1.08 * 7, 1.08 * 7))
    reach = 1.08 * np.degrees(0.035)
    assert angles.get_ylim() == pytest.approx((-reach, reach))
    assert not angles.spines["top"].get_visible()
    assert not shifts.get_legend().get_frame_on()


def test_without_motion_the_scales_of_figure_4_are_not_empty(rendered):
    still = np.zeros((4, 3))
    transforms = np.tile(np.eye(3), (4, 1, 1))
    record = CameraRecord(still, still, still, transforms, np.ones(4, bool))
    draw_correction(record)
    for axes in rendered[0].axes:
        assert axes.get_ylim() == pytest.approx((-0.00108, 0.00108))
    assert most_moved(record, (320, 240)) == 0


def test_the_frame_that_moved_farthest_is_that_of_the_farthest_corner():
    record = known_camera()
    assert most_moved(record, (320, 240)) == 7
    record.stab_from_raw[3] = rigid(0, 0, 0.1, (160, 120))  # a corner moves by about 20 px
    assert most_moved(record, (320, 240)) == 3
    record.stab_from_raw[6, :2, 2] = 0, -30
    assert most_moved(record, (320, 240)) == 6


def test_unknown_motion_keeps_both_paths(monkeypatch):
    """Also in the first frame, to which there is no motion."""
    motions = [
        Motion.none((320, 240)),
        Motion(rigid(4, -2, 0, (159.5, 119.5)), 1.0, True, (320, 240)),
        Motion(rigid(90, 50, 0, (159.5, 119.5)), 0.1, False, (320, 240)),
        Motion(rigid(2, 0, 0, (159.5, 119.5)), 1.0, True, (320, 240)),
    ]
    monkeypatch.setattr(camera_figures, "camera_motions", lambda *arguments: iter(motions))
    record = record_camera(None, PAPER)
    assert record.reliable.tolist() == [True, True, False, True]
    np.testing.assert_allclose(record.path[:, 0], [0, 4, 4, 6], atol=1e-9)
    np.testing.assert_allclose(record.path[:, 1], [0, -2, -2, -2], atol=1e-9)
    np.testing.assert_allclose(record.smooth[:, 0], [0, 2, 2, 10 / 3], atol=1e-9)
    np.testing.assert_allclose(record.new_trans, record.smooth - record.path, atol=1e-9)
    assert record.stab_from_raw.shape == (4, 3, 3)


def test_captions_name_the_window_the_border_and_the_kind_of_run(found):
    captions = {name: each.caption for name, each in named_figures(found).items()}
    assert f"its mean over the last {PAPER.paper.window} frames." in captions["fig3"]
    assert f"{PAPER.border} pixels are added on each side" in captions["fig5"]
    for name in ("fig1", "fig6", "boxes"):
        assert captions[name].endswith("five frames after each loss; no box in between.")
    assert "no interval is defined for this dataset" in captions["eao"]
    titles = {name: each.title for name, each in named_figures(found).items()}
    assert titles["ranking"].startswith("Ranking: success on ")
    assert titles["boxes"].endswith(", alone and stabilized")
