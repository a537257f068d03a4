"""Figures: what they are drawn from is right, and every one of them is a picture."""

import cv2
import numpy as np
import pytest

from helpers.benched import bench, write_run, write_vot_year
from helpers.shaky_dataset import write_dataset
from helpers.synthetic import generator, poses, seen, world
from ssiam.datasets import VideoSequence, open_dataset
from ssiam.errors import MissingExtraError
from ssiam.evaluation.differing import Differing, most_differing
from ssiam.evaluation.entries import Entry
from ssiam.evaluation.figures import figures
from ssiam.evaluation.gathering import summarize
from ssiam.evaluation.path_figure import camera_path
from ssiam.stabilize import StabilizerConfig

PAPER = StabilizerConfig("paper")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    data = write_dataset(tmp_path_factory.mktemp("tiny"))
    out = tmp_path_factory.mktemp("out")
    bench(data, out, [Entry("kcf", StabilizerConfig("off")), Entry("kcf", PAPER)])
    return summarize(out, open_dataset(data))


def picture(png):
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)


def test_all_three_are_pictures(found):
    drawn, notes = figures(found)
    assert notes == []
    assert [each.name[:4] for each in drawn] == ["fig3", "fig4", "fig6"]
    for each in drawn:
        assert picture(each.png).std() > 10
        assert min(picture(each.png).shape[:2]) > 300


def test_the_path_is_the_known_one(tmp_path):
    size = (320, 240)
    shifts = generator(5).normal(0, (3, 2, 0.004), (20, 3)).cumsum(axis=0)
    for index, pose in enumerate(poses(shifts, size)):
        cv2.imwrite(str(tmp_path / f"{index:02}.png"), seen(world(1, size), pose))
    images = tuple(sorted(tmp_path.glob("*.png")))
    path, smooth, known = camera_path(VideoSequence("s", images, np.full((20, 4), np.nan)), PAPER)
    assert known.all()
    assert np.abs(path - (shifts - shifts[0]))[:, :2].max() < 1
    assert np.abs(path - (shifts - shifts[0]))[:, 2].max() < 0.003
    means = np.array([path[: index + 1].mean(axis=0) for index in range(20)])
    assert np.abs(smooth - means)[:, :2].max() < 0.2


def differing(off, steadied):
    truth = np.tile([10.0, 10, 20, 20], (len(off), 1))
    boxes = []
    for overlaps in (off, steadied):
        each = truth.copy()
        each[:, 2] *= overlaps  # a narrower box, of just that overlap
        each[np.asarray(overlaps) == 0] = np.nan
        boxes.append(each)
    return Differing("kcf", None, False, truth, *boxes)


def test_frames_that_differ_most_come_in_order_and_apart():
    steadied = np.full(90, 0.9)
    steadied[[7, 8, 40, 41, 80]] = 0.1, 0.0, 0.2, 0.25, 0.8
    found = differing(np.full(90, 0.9), steadied)
    assert found.frames == [8, 40, 80]
    assert found.overlaps[:, 8] == pytest.approx([0.9, 0])


def test_where_nothing_differs_there_is_no_frame():
    assert differing(np.full(9, 0.5), np.full(9, 0.5)).frames == []


def test_the_sequence_is_the_one_with_the_largest_difference_of_lost_targets(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 40, "two": 40})
    for label, loses in (("kcf-off", "two"), ("kcf-paper", "")):
        for name in ("one", "two"):
            codes = "i" + "." * 19 + ("x----i" if name == loses else "......") + "." * 14
            write_run(tmp_path / "out", label, name, codes)
    found = summarize(tmp_path / "out", open_dataset(data))
    assert most_differing(found).sequence.name == "two"


def test_without_frames_or_pairs_a_figure_is_left_out_with_a_line(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 120})
    write_run(tmp_path / "out", "kcf-off", "one", "i" + "." * 119)
    drawn, notes = figures(summarize(tmp_path / "out", open_dataset(data)))
    assert [each.name for each in drawn] == ["fig6-VOT2018"]
    assert picture(drawn[0].png).std() > 5
    assert len(notes) == 2
    assert "no figure 3" in notes[0]
    assert "00000002.jpg" in notes[0]
    assert "no figure 4" in notes[1]


def test_only_varied_numbers_leave_figure_6_out(tmp_path):
    data = write_vot_year(tmp_path / "VOT2018", {"one": 20})
    write_run(tmp_path / "out", "kcf-paper-tha=0.5", "one", "i" + "." * 19)
    drawn, notes = figures(summarize(tmp_path / "out", open_dataset(data)))
    assert drawn == []
    assert "no figure 6" in notes[2]


def test_without_matplotlib_the_extra_is_named(found, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"ssiam\[bench\]"):
        figures(found)
