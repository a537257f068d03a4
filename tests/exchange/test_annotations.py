"""Annotations from results: written results are read back, arguments are checked."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.written_results import CORNERS, FPS, SIZE, TRACKS, csv_of, written
from ssiam.errors import ArgumentError
from ssiam.exchange import Annotation, Annotations, read_annotations
from ssiam.exchange.annotations import annotation_from_track
from ssiam.track import Track


@pytest.mark.parametrize("name", ["r.csv", "r.jsonl"])
def test_written_results_are_read_back(tmp_path, name):
    frames = [list(TRACKS.values())] * 2
    read = read_annotations(written(tmp_path / name, frames), SIZE, FPS)
    assert (read.size_wh, read.fps, read.frame_count) == (SIZE, FPS, 2)
    assert read.names == ("target 1", "target 2", "target 3")
    assert read.rows == tuple(
        annotation_from_track(frame, frame / 25, target, track)
        for frame, tracks in enumerate(frames)
        for target, track in enumerate(tracks, start=1)
    )
    assert read.rows[1].corners == tuple(map(tuple, CORNERS.tolist()))


pixels = st.floats(-1e6, 1e6).map(lambda value: round(value, 3) + 0.0)
tracks = st.builds(
    Track,
    st.tuples(pixels, pixels, pixels, pixels),
    st.floats(0, 1).map(lambda value: round(value, 4)),
    st.booleans(),
    st.none() | st.lists(pixels, min_size=8, max_size=8).map(lambda v: np.array(v).reshape(4, 2)),
)


@given(st.lists(tracks, min_size=1, max_size=4), st.sampled_from(["csv", "jsonl"]))
def test_any_track_is_read_back(frames, suffix):
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder) / f"r.{suffix}", [[track] for track in frames])
        rows = read_annotations(path, SIZE, FPS).rows
    assert rows == tuple(
        annotation_from_track(i, i / 25, 1, track) for i, track in enumerate(frames)
    )


@pytest.mark.parametrize("name", ["r.csv", "r.jsonl"])
def test_box_that_is_not_finite_is_lost(tmp_path, name):
    not_finite = Track((math.nan, 2, 3, 4), score=math.nan, corners=np.full((4, 2), math.nan))
    (row,) = read_annotations(written(tmp_path / name, [[not_finite]]), SIZE, FPS).rows
    assert row == Annotation(0, 0.0, 1, (0.0, 0.0, 0.0, 0.0), None, 0.0, lost=True)
    assert row == annotation_from_track(0, 0.0, 1, not_finite)
    assert not row.visible


def test_frames_and_targets_may_be_missing(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(csv_of({"frame": "7", "target": "2", "time": ""}, {"frame": "5"}) + "\n")
    read = read_annotations(path, SIZE, FPS, ["a", "b"])
    assert [(row.frame, row.target, row.time) for row in read.rows] == [(7, 2, None), (5, 1, 0.12)]
    assert (read.frame_count, read.names) == (8, ("a", "b"))
    assert {target: [row.frame for row in rows] for target, rows in read.tracks().items()} == {
        1: [5],
        2: [7],
    }


def test_table_without_rows_has_no_targets(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(csv_of())
    read = read_annotations(path, SIZE, FPS)
    assert (read.rows, read.names, read.frame_count) == ((), (), 0)


@pytest.mark.parametrize(
    ("size_wh", "fps", "names", "words"),
    [
        pytest.param((0, 96), 25, ["a"], "is not positive", id="no width"),
        pytest.param(SIZE, 0, ["a"], "frame rate 0 is not", id="no rate"),
        pytest.param(SIZE, math.inf, ["a"], "frame rate inf is not", id="infinite rate"),
        pytest.param(SIZE, math.nan, ["a"], "frame rate nan is not", id="nan rate"),
        pytest.param(SIZE, 25, ["a", "b"], "2 names for the 1 targets", id="names"),
        pytest.param(SIZE, 25, [], "0 names for the 1 targets", id="no names"),
    ],
)
def test_invalid_arguments_are_refused(tmp_path, size_wh, fps, names, words):
    path = written(tmp_path / "r.csv", [[TRACKS["plain"]]])
    with pytest.raises(ArgumentError, match=words):
        read_annotations(path, size_wh, fps, names)


def test_every_target_needs_a_name():
    row = Annotation(0, None, 2, (1.0, 2.0, 3.0, 4.0))
    with pytest.raises(ArgumentError, match="1 names for 2 targets"):
        Annotations(SIZE, 25, ("a",), (row,))


def test_length_may_exceed_the_rows():
    row = Annotation(4, None, 1, (1.0, 2.0, 3.0, 4.0))
    assert Annotations(SIZE, 25, ("a",), (row,)).frame_count == 5
    assert Annotations(SIZE, 25, ("a",), (row,), length=9).frame_count == 9
    assert Annotations(SIZE, 25, ("a",), (row,), length=2).frame_count == 5


def test_unprintable_characters_in_names_are_replaced():
    names = ("boat\n\x00\ud800", "", "Müller 船")
    annotations = Annotations(SIZE, 25, names, ())
    printable = [annotations.name(target) for target in (1, 2, 3)]
    assert printable == ["boat\ufffd\ufffd\ufffd", "target 2", "Müller 船"]
