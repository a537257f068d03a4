"""Result files of OTB, LaSOT and GOT-10k, and file names."""

import numpy as np
import pytest

from helpers.benchmark_runs import same, square
from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.runs.result_files import (
    ResultsError,
    got10k_path,
    otb_path,
    read_boxes,
    read_got10k,
    vot_path,
    write_boxes,
    write_got10k,
)

NAN = np.nan


@pytest.mark.parametrize("name", ["", ".", "..", "../a", "a/b", "a\\b", "a\0b"])
@pytest.mark.parametrize("path", [vot_path, otb_path, got10k_path])
def test_names_outside_of_the_folder_are_refused(tmp_path, name, path):
    with pytest.raises(ArgumentError, match="not a sequence name"):
        path(tmp_path, name)


@pytest.mark.parametrize("origin", [0, 1])
def test_boxes_round_trip(tmp_path, origin):
    boxes = np.array([[0, 0, 10, 20], [1.5, -2.25, 3, 4], [NAN] * 4])
    path = otb_path(tmp_path, "Basketball")
    write_boxes(path, Trajectory.from_regions(boxes), origin=origin)
    lines = path.read_text().splitlines()
    assert lines[0] == f"{origin}.000,{origin}.000,10.000,20.000"
    assert lines[2] == "0.000,0.000,0.000,0.000"
    same(read_boxes(path, origin=origin).first(2), Trajectory.from_regions(boxes[:2]))


@pytest.mark.parametrize("line", ["3,4,5,6", "3\t4\t5\t6", "3 4 5 6", " 3,  4,5 ,6"])
def test_separators_of_one_pass_files(tmp_path, line):
    (tmp_path / "a.txt").write_text(f"{line}\n{line}\n")
    assert read_boxes(tmp_path / "a.txt").regions.tolist() == [[2, 3, 5, 6]] * 2


def test_a_nan_box_is_skipped(tmp_path):
    (tmp_path / "a.txt").write_text("1,1,5,5\nNaN,NaN,NaN,NaN\n")
    assert read_boxes(tmp_path / "a.txt").status.tolist() == [Status.TRACKED, Status.SKIPPED]
    (tmp_path / "a.txt").write_text("1,1,5,5\n1,1,5\n")
    with pytest.raises(ResultsError, match="line 2: not a box: expected x,y,w,h, got 3 numbers"):
        read_boxes(tmp_path / "a.txt")


def test_polygons_are_refused(tmp_path):
    with pytest.raises(ArgumentError, match="not polygons"):
        write_boxes(tmp_path / "a.txt", Trajectory.from_regions(square(3)))


def test_got10k_with_times_and_repetitions(tmp_path):
    runs = [
        Trajectory.from_regions(square(4)[:, :4] + shift, seconds=np.full(4, 0.125 + shift))
        for shift in range(3)
    ]
    write_got10k(tmp_path, "GOT-10k_Test_000001", runs)
    folder = tmp_path / "GOT-10k_Test_000001"
    assert sorted(path.name for path in folder.iterdir()) == [
        *(f"GOT-10k_Test_000001_00{n}.txt" for n in (1, 2, 3)),
        "GOT-10k_Test_000001_time.txt",
    ]
    found = read_got10k(tmp_path, "GOT-10k_Test_000001")
    for run, written in zip(found, runs, strict=True):
        same(run, written)
        np.testing.assert_array_equal(run.seconds, written.seconds)
    assert read_got10k(tmp_path, "another") == []
