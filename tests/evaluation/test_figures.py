"""Figures: the data behind them, and the images."""

import cv2
import numpy as np
import pytest

from helpers.benched import bench, write_run, write_vot_year
from helpers.shaky_dataset import write_dataset
from helpers.synthetic import camera_frame, generator, poses, world
from ssiam.datasets import VideoSequence, open_dataset
from ssiam.errors import MissingExtraError
from ssiam.evaluation.paper.figures import camera_path, figures
from ssiam.evaluation.paper.qualitative import Example, largest_difference
from ssiam.evaluation.paper.summary import summarize
from ssiam.evaluation.runs.entries import Entry
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


def test_all_three_figures_are_drawn(found):
    drawn, notes = figures(found)
    assert notes == []
    assert [each.name[:4] for each in drawn] == ["fig3", "fig4", "fig6"]
    for each in drawn:
        assert decoded(each.png).std() > 10
        assert min(decoded(each.png).shape[:2]) > 300


def test_the_camera_path_of_a_known_motion(tmp_path):
    size = (320, 240)
    shifts = generator(5).normal(0, (3, 2, 0.004), (20, 3)).cumsum(axis=0)
    for index, pose in enumerate(poses(shifts, size)):
        cv2.imwrite(str(tmp_path / f"{index:02}.png"), camera_frame(world(1, size), pose))
    images = tuple(sorted(tmp_path.glob("*.png")))
    path, smooth, known = camera_path(VideoSequence("s", images, np.full((20, 4), np.nan)), PAPER)
    assert known.all()
    assert np.abs(path - (shifts - shifts[0]))[:, :2].max() < 1
    assert np.abs(path - (shifts - shifts[0]))[:, 2].max() < 0.003
    means = np.array([path[: index + 1].mean(axis=0) for index in range(20)])
    assert np.abs(smooth - means)[:, :2].max() < 0.2


def example(off, stabilized):
    truth = np.tile([10.0, 10, 20, 20], (len(off), 1))
    boxes = []
    for overlaps in (off, stabilized):
        each = truth.copy()
        each[:, 2] *= overlaps  # a narrower box with exactly this overlap
        each[np.asarray(overlaps) == 0] = np.nan
        boxes.append(each)
    return Example("kcf", None, False, truth, *boxes)


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
    assert [each.name for each in drawn] == ["fig6-VOT2018"]
    assert decoded(drawn[0].png).std() > 5
    assert len(notes) == 2
    assert "no figure 3" in notes[0]
    assert "00000002.jpg" in notes[0]
    assert "no figure 4" in notes[1]


def test_figure_6_needs_an_entry_with_default_settings(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 20})
    write_run(tmp_path / "out", "kcf-paper-tha=0.5", "one", "i" + "." * 19)
    drawn, notes = figures(summarize(tmp_path / "out", open_dataset(data)))
    assert drawn == []
    assert "no figure 6" in notes[2]


def test_missing_matplotlib_names_the_extra(found, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"ssiam\[bench\]"):
        figures(found)
