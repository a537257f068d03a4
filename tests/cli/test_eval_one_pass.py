"""`ssiam eval` of one-pass results, in every layout."""

import json

import numpy as np
import pytest

from ssiam.cli import main
from ssiam.evaluation.measures.trajectory import Trajectory
from ssiam.evaluation.runs.result_files import (
    otb_path,
    vot_path,
    write_boxes,
    write_got10k,
    write_vot,
)


def one_pass_folder(folder, layout, shift):
    """OTB ground-truth boxes, shifted by `shift` pixels, in one of the layouts."""
    boxes = np.tile([20.0 + shift, 10.0, 30.0, 40.0], (12, 1))
    run = Trajectory.from_regions(boxes)
    if layout == "otb":
        write_boxes(otb_path(folder, "clip"), run)
    elif layout == "bench":
        write_boxes(otb_path(folder / "ope", "clip"), run)
    elif layout == "got10k":
        write_got10k(folder, "clip", [run])
    else:
        write_vot(vot_path(folder, "clip", experiment="unsupervised"), run)
    return folder


@pytest.fixture
def otb(tmp_path):
    folder = tmp_path / "OTB100" / "clip"
    (folder / "img").mkdir(parents=True)
    for number in range(12):
        (folder / "img" / f"{number + 1:04d}.jpg").write_bytes(b"")
    (folder / "groundtruth_rect.txt").write_text("21,11,30,40\n" * 12)
    return folder.parent


@pytest.mark.parametrize("layout", ["otb", "bench", "got10k", "vot"])
def test_every_layout_gives_the_same_measures(layout, otb, tmp_path, capsys):
    folder = one_pass_folder(tmp_path / "runs" / "half", layout, shift=15.0)
    arguments = ["eval", str(folder), "--dataset", str(otb), "--experiment", "ope", "--json"]
    assert main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ao"] == pytest.approx(1 / 3)
    assert found["success"] == pytest.approx(7 / 21)
    assert found["precision"] == 1
    assert found["normalised_precision"] == 0
    assert found["sequences"] == 1


def test_folder_of_trackers_gives_a_table(otb, tmp_path, capsys):
    for name, shift in (("good", 0.0), ("bad", 60.0)):
        one_pass_folder(tmp_path / "runs" / name, "bench", shift)
    arguments = ["eval", str(tmp_path / "runs"), "--dataset", str(otb), "--experiment", "ope"]
    assert main(arguments) == 0
    output = capsys.readouterr().out
    assert "good" in output
    assert "bad" in output


def test_folder_without_one_pass_results_is_refused(otb, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    arguments = ["eval", str(tmp_path / "empty"), "--dataset", str(otb), "--experiment", "ope"]
    assert main(arguments) == 2
    assert "one-pass results" in capsys.readouterr().err
