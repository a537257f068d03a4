"""A tracker's folder of results: what is read, left out, cut and refused."""

import os

import numpy as np
import pytest

from helpers.benchmark_runs import square, trajectory
from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.trajectory import Trajectory
from ssiam.evaluation.runs import result_files
from ssiam.evaluation.runs.result_files import (
    ResultsError,
    got10k_path,
    line_error,
    read_boxes,
    read_got10k,
    read_lines,
    read_results,
    read_vot,
    repetitions,
    vot_path,
    write_got10k,
    write_lines,
    write_vot,
)


def sequence(name, count=5):
    return VideoSequence(name, (), square(count))


def write(folder, name, codes, repetition=1, experiment="baseline"):
    path = vot_path(folder, name, repetition, experiment)
    write_vot(path, trajectory(codes, square(len(codes))))
    return path


def test_all_repetitions_of_all_sequences_are_read(tmp_path):
    for repetition in (1, 2, 3):
        write(tmp_path, "bag", "itttt", repetition)
    write(tmp_path, "ball", "itx--")
    found = read_results(tmp_path, [sequence("bag"), sequence("ball")])
    assert found.name == tmp_path.name
    assert found.notes == ()
    assert [each.sequence.name for each in found.tracked] == ["bag", "ball"]
    assert [len(each.runs) for each in found.tracked] == [3, 1]
    assert found.tracked[1].runs[0].status.tolist() == [1, 3, 2, 0, 0]


def test_the_name_of_the_current_folder_is_known(tmp_path, monkeypatch):
    write(tmp_path, "bag", "itttt")
    monkeypatch.chdir(tmp_path)
    assert read_results(result_files.Path(), [sequence("bag")]).name == tmp_path.name


@pytest.mark.parametrize("experiment", ["baseline", "realtime", "unsupervised"])
def test_only_the_experiment_is_read(tmp_path, experiment):
    path = write(tmp_path, "bag", "itttt", experiment=experiment)
    assert path == tmp_path / experiment / "bag" / "bag_001.txt"
    assert len(read_results(tmp_path, [sequence("bag")], experiment).tracked) == 1
    other = "realtime" if experiment == "baseline" else "baseline"
    with pytest.raises(ResultsError) as caught:
        read_results(tmp_path, [sequence("bag")], other)
    expected = f"{other}/<sequence>/<sequence>_001.txt"
    assert str(caught.value) == f"{tmp_path}: no results of the dataset; expected {expected}"


def test_sequences_without_results_are_noted(tmp_path):
    write(tmp_path, "bag", "itttt")
    found = read_results(tmp_path, [sequence("zebra"), sequence("bag")])
    assert [each.sequence.name for each in found.tracked] == ["bag"]
    assert found.notes == (f"{tmp_path}: no results for sequence zebra; it is left out",)


def test_a_similar_name_is_proposed(tmp_path):
    write(tmp_path, "bag", "itttt")
    write(tmp_path, "Basketball", "itttt")
    (tmp_path / "baseline" / "basketball").mkdir()
    found = read_results(tmp_path, [sequence("bag"), sequence("basketball")])
    assert found.notes == (
        f"{tmp_path}: no results for sequence basketball; it is left out "
        "(is Basketball meant? rename it and the files in it)",
    )


@pytest.mark.parametrize(("length", "measured"), [(3, 3), (8, 5)])
def test_runs_of_another_length_are_measured_over_the_common_frames(tmp_path, length, measured):
    path = write(tmp_path, "bag", "itttt")
    found = read_results(tmp_path, [sequence("bag", length)])
    assert len(found.tracked[0].runs[0]) == measured
    note = f"{path}: 5 lines for {length} frames; the first {measured} are measured"
    assert found.notes == (note,)


def test_an_empty_run_is_refused(tmp_path):
    path = vot_path(tmp_path, "bag")
    write_lines(path, [])
    with pytest.raises(ResultsError) as caught:
        read_results(tmp_path, [sequence("bag")])
    assert str(caught.value) == f"{path}: is empty; delete it to leave the sequence out"


def test_more_failures_than_starts_are_refused(tmp_path):
    write(tmp_path, "ball", "itxit")
    path = write(tmp_path, "bag", "itxtx")
    assert len(read_results(tmp_path, [sequence("ball")]).tracked) == 1
    with pytest.raises(ResultsError) as caught:
        read_results(tmp_path, [sequence("bag")])
    expected = f"{path}: has more failures (2) than starts (1); is it truncated?"
    assert str(caught.value) == expected


def test_lines_have_their_numbers_and_values(tmp_path):
    (tmp_path / "a.txt").write_text("1\n2.5, -3\t4\n1e2 nan\n\n \n")
    (first, one), (second, three), (third, two) = read_lines(tmp_path / "a.txt")
    assert (first, second, third) == (1, 2, 3)
    assert (one, three, two[0]) == ([1], [2.5, -3, 4], 100)
    assert np.isnan(two[1])
    assert str(line_error(tmp_path, 7, "why")) == f"{tmp_path}, line 7: why"


def test_long_lines_are_shortened_to_40_characters(tmp_path):
    for length, shown in ((40, "'" + "x" * 40 + "'"), (41, "'" + "x" * 40 + "...'")):
        (tmp_path / "a.txt").write_text("x" * length)
        with pytest.raises(ResultsError) as caught:
            list(read_lines(tmp_path / "a.txt"))
        expected = f"{tmp_path / 'a.txt'}, line 1: {shown} is not a line of numbers"
        assert str(caught.value) == expected


def test_files_up_to_the_limit_are_read(tmp_path, monkeypatch):
    assert result_files._MAX_BYTES == 64 * 2**20
    path = tmp_path / "a.txt"
    path.write_text("1,2,3,4\n")
    monkeypatch.setattr(result_files, "_MAX_BYTES", 8)
    assert len(read_boxes(path)) == 1
    path.write_text("1,2,3,4\n\n")
    with pytest.raises(ResultsError) as caught:
        read_boxes(path)
    assert str(caught.value) == f"{path}: has 9 bytes; results have at most 8"


def test_the_reason_is_named_if_a_file_cannot_be_read(tmp_path):
    with pytest.raises(ResultsError) as caught:
        read_vot(tmp_path / "none.txt")
    reason = "cannot be read (No such file or directory)"
    assert str(caught.value) == f"{tmp_path / 'none.txt'}: {reason}"
    with pytest.raises(ResultsError) as caught:
        read_vot(tmp_path)
    expected = f"{tmp_path}: is not a regular file; results are text files"
    assert str(caught.value) == expected


def test_a_file_in_place_of_the_folder_has_no_repetitions(tmp_path):
    (tmp_path / "bag").touch()
    assert repetitions(tmp_path / "bag" / "bag_001.txt") == []


def test_names_with_special_characters_are_not_patterns(tmp_path):
    write(tmp_path, "a.b", "it")
    (tmp_path / "baseline" / "a.b" / "aXb_002.txt").touch()
    (tmp_path / "baseline" / "a.b" / "a.b_003xtxt").touch()
    (path,) = repetitions(vot_path(tmp_path, "a.b"))
    assert path.name == "a.b_001.txt"


def test_the_precision_of_each_format(tmp_path):
    regions = np.full((1, 4), 1.23456789)
    run = Trajectory.from_regions(regions, seconds=np.array([0.123456789]))
    write_vot(tmp_path / "a.txt", run)
    assert (tmp_path / "a.txt").read_text() == "1.2346,1.2346,1.2346,1.2346\n"
    write_got10k(tmp_path, "b", [run])
    assert got10k_path(tmp_path, "b").read_text() == "1.235,1.235,1.235,1.235\n"
    assert (tmp_path / "b" / "b_time.txt").read_text() == "0.12345679\n"


def test_runs_without_times_have_zeros(tmp_path):
    timed = Trajectory.from_regions(square(2)[:, :4], seconds=np.array([0.5, 0.25]))
    write_got10k(tmp_path, "b", [Trajectory.from_regions(square(2)[:, :4]), timed])
    first, second = read_got10k(tmp_path, "b")
    assert first.seconds.tolist() == [0, 0]
    assert second.seconds.tolist() == [0.5, 0.25]


def test_without_a_file_of_times_the_times_are_unknown(tmp_path):
    write_got10k(tmp_path, "b", [Trajectory.from_regions(square(2)[:, :4])])
    times = tmp_path / "b" / "b_time.txt"
    times.write_text("0.5\n")  # fewer rows than boxes
    (run,) = read_got10k(tmp_path, "b")
    assert run.seconds[0] == 0.5
    assert np.isnan(run.seconds[1])
    times.unlink()
    assert read_got10k(tmp_path, "b")[0].seconds is None


@pytest.mark.parametrize(
    ("text", "line"), [("0.5\n0.5\n0.5\n", 3), ("0.5\n0.5\n", 1)], ids=["rows", "columns"]
)
def test_times_of_other_runs_are_refused(tmp_path, text, line):
    runs = [Trajectory.from_regions(square(2)[:, :4])] * (1 if line == 3 else 2)
    write_got10k(tmp_path, "b", runs)
    times = tmp_path / "b" / "b_time.txt"
    times.write_text(text)
    with pytest.raises(ResultsError) as caught:
        read_got10k(tmp_path, "b")
    reason = "expected one row per box and one column per repetition"
    assert str(caught.value) == f"{times}, line {line}: {reason}"


def test_a_write_never_shows_an_unfinished_file(tmp_path, monkeypatch):
    """While lines are written, the folder shows the earlier file and nothing else."""
    path = tmp_path / "a.txt"
    write_lines(path, ["old"])
    seen = []

    def look(handle):
        names = [each.name for each in tmp_path.iterdir() if not each.name.startswith(".")]
        seen.append((names, path.read_text()))

    monkeypatch.setattr(os, "fsync", look)
    write_lines(path, ["new", "lines"])
    assert seen[0] == (["a.txt"], "old\n")
    assert path.read_text() == "new\nlines\n"
