"""Result files of VOT: round trip, spellings, damage, atomic writes."""

import os
import stat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from helpers.benchmark_runs import same, square, trajectory
from ssiam.errors import SinkError
from ssiam.evaluation.measures.trajectory import Trajectory
from ssiam.evaluation.runs.result_files import (
    ResultsError,
    read_vot,
    repetitions,
    vot_path,
    write_vot,
)

NAN = np.nan


@pytest.mark.parametrize("columns", [4, 8], ids=["rectangles", "polygons"])
def test_vot_files_round_trip(tmp_path, columns):
    run = trajectory("itttx----itt", square(12)[:, :columns] + 0.1234)
    path = vot_path(tmp_path, "bag")
    write_vot(path, run)
    assert path == tmp_path / "baseline" / "bag" / "bag_001.txt"
    same(read_vot(path), run)


@given(arrays(np.float64, (3, 8), elements=st.floats(-1e6, 1e6)))
def test_numbers_round_trip_to_four_decimals(tmp_path_factory, regions):
    path = tmp_path_factory.mktemp("vot") / "a_001.txt"
    write_vot(path, Trajectory.from_regions(regions))
    same(read_vot(path), Trajectory.from_regions(regions), atol=6e-5)


def test_rectangles_and_polygons_in_one_file(tmp_path):
    (tmp_path / "a.txt").write_text("1\n1,2,3,4\n1,2,3,4,5,6,7,8\n2\n0\n0\n0\n0\n1\n")
    run = read_vot(tmp_path / "a.txt")
    assert run.status.tolist() == [1, 3, 3, 2, 0, 0, 0, 0, 1]
    assert run.regions[1, :5].tolist()[:4] == [1, 2, 3, 4]
    assert np.isnan(run.regions[1, 4:]).all()
    assert run.regions[2].tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    assert run.failures.tolist() == [3]
    assert run.initializations.tolist() == [0, 8]
    write_vot(tmp_path / "b.txt", run)
    same(read_vot(tmp_path / "b.txt"), run)


READ = [
    # name, text, statuses
    ("vot-toolkit's floats", "1.0\n10.5,2.25,3,4\n", [1, 3]),
    ("Windows", "1\r\n1,2,3,4\r\n", [1, 3]),
    ("no last newline, spaces", "1\n1, 2, 3, 4", [1, 3]),
    ("tabs, empty lines at the end", "1\n1\t2\t3\t4\n\n\n", [1, 3]),
    ("nan is skipped", "1\nnan,nan,nan,nan\nNaN,1,2,3\n", [1, 0, 0]),
    ("nothing", "", []),
]


@pytest.mark.parametrize(
    ("text", "statuses"), [pytest.param(*case[1:], id=case[0]) for case in READ]
)
def test_spellings_of_vot_files(tmp_path, text, statuses):
    (tmp_path / "a.txt").write_bytes(text.encode())
    assert read_vot(tmp_path / "a.txt").status.tolist() == statuses


NO_REGION = "not a region: expected 0, 1, 2, x,y,w,h or four x,y, got"
DAMAGED = [
    # name, bytes, words of the message
    ("a word", b"1\nfoo\n", "line 2: 'foo' is not a line of numbers"),
    ("code", b"1\n__import__('os')\n", "line 2"),
    (
        "an unknown code",
        b"1\n7\n",
        f"line 2: {NO_REGION} 1 numbers",
    ),
    (
        "half a line",
        b"1\n1,2,3\n",
        f"line 2: {NO_REGION} 3 numbers",
    ),
    (
        "five corners",
        b"1,2,3,4,5,6,7,8,9,10\n",
        f"line 1: {NO_REGION} 10 numbers",
    ),
    ("infinity", b"1\ninf,1,2,3\n", "line 2: 'inf,1,2,3' is not a line of finite numbers"),
    ("an empty line", b"1\n\n1,2,3,4\n", "line 2: '' is not"),
    ("a mask", b"m1,2,3,4,5\n", "line 1: 'm1,2,3,4,5' is not a line of numbers"),
    ("a long line", b"x" * 500, f"'{'x' * 40}...'"),
    ("an image", bytes(range(256)), "is not text"),
    ("a web page", b"<!DOCTYPE html>\n<html>", "line 1: '<!DOCTYPE html>'"),
]


@pytest.mark.parametrize(
    ("content", "words"), [pytest.param(*case[1:], id=case[0]) for case in DAMAGED]
)
def test_damaged_files_are_an_error_with_their_path(tmp_path, content, words):
    path = tmp_path / "a_001.txt"
    path.write_bytes(content)
    with pytest.raises(ResultsError) as caught:
        read_vot(path)
    assert str(path) in str(caught.value)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_special_and_huge_files_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(2**40)
    for name, words in [
        ("missing", "cannot be read"),
        ("pipe", "not a regular file"),
        ("huge", "bytes"),
    ]:
        with pytest.raises(ResultsError, match=words):
            read_vot(tmp_path / name)


def test_repetitions_are_sorted_without_other_files(tmp_path):
    for number in (2, 1, 15):
        write_vot(vot_path(tmp_path, "bag", number), trajectory("it", square(2)))
    folder = vot_path(tmp_path, "bag").parent
    for name in ("bag_time.txt", "bag_001_confidence.value", "bag_01.txt", "big_001.txt"):
        (folder / name).write_text("")
    found = repetitions(vot_path(tmp_path, "bag"))
    assert [path.name for path in found] == ["bag_001.txt", "bag_002.txt", "bag_015.txt"]
    assert repetitions(vot_path(tmp_path, "none")) == []


def test_a_failed_write_leaves_the_file_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "a_001.txt"
    write_vot(path, trajectory("it", square(2)))
    before = path.read_text()

    def full_disk(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(SinkError, match=r"a_001\.txt: cannot be written \(No space left"):
        write_vot(path, trajectory("ittttt", square(6)))
    assert path.read_text() == before
    assert [each.name for each in tmp_path.iterdir()] == ["a_001.txt"]


def test_files_have_default_permissions(tmp_path):
    write_vot(tmp_path / "a.txt", trajectory("it", square(2)))
    (tmp_path / "b.txt").touch()
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("a.txt", "b.txt")}
    assert len(modes) == 1


def test_a_folder_that_cannot_be_created(tmp_path):
    (tmp_path / "baseline").write_text("a file")
    with pytest.raises(SinkError, match="cannot be written"):
        write_vot(vot_path(tmp_path, "bag"), trajectory("it", square(2)))
