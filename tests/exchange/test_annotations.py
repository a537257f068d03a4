"""Results read back as they were written, and refused in one line where they are damaged."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ssiam.errors import ArgumentError
from ssiam.exchange import Annotation, Annotations, AnnotationsError, read_annotations
from ssiam.exchange.annotations import annotation_of
from ssiam.geometry import rigid
from ssiam.motion import Motion
from ssiam.trackers import Track
from ssiam.video import open_results
from ssiam.video.layouts import COLUMNS

SIZE, FPS = (160, 96), 25.0
CORNERS = np.array([[0.0, 1.0], [5.0, 1.5], [4.5, 7.0], [-0.5, 6.0]])
MOTION = Motion(rigid(3.0, -2.0, 0.01, (79.5, 47.5)), 0.75, True, SIZE)
TRACKS = {
    "plain": Track((10.123, 20.0, 30.5, 40.25), score=0.9877),
    "turned": Track((0.5, 1.0, 5.0, 6.0), score=0.5, corners=CORNERS, motion=MOTION),
    "lost": Track((1.0, 2.0, 3.0, 4.0), score=0.01, lost=True),
}
NUMBERS = ("3", "0.12", "1", "10", "20", "30", "40", "0.9", "0")
ROW = dict.fromkeys(COLUMNS, "") | dict(zip(COLUMNS, NUMBERS, strict=False))


def written(path, frames):
    with open_results(path, targets=len(frames[0])) as sink:
        for index, tracks in enumerate(frames):
            sink.write(index, index / 25, tracks)
    return path


def csv_of(*rows):
    lines = [",".join(COLUMNS), *(",".join((ROW | row).values()) for row in rows)]
    return "".join(f"{line}\n" for line in lines)


@pytest.mark.parametrize("name", ["r.csv", "r.jsonl"])
def test_what_ssiam_track_writes_comes_back(tmp_path, name):
    frames = [list(TRACKS.values())] * 2
    read = read_annotations(written(tmp_path / name, frames), SIZE, FPS)
    assert (read.size_wh, read.fps, read.frame_count) == (SIZE, FPS, 2)
    assert read.names == ("target 1", "target 2", "target 3")
    assert read.rows == tuple(
        annotation_of(frame, frame / 25, target, track)
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
def test_any_track_comes_back(frames, suffix):
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder) / f"r.{suffix}", [[track] for track in frames])
        rows = read_annotations(path, SIZE, FPS).rows
    assert rows == tuple(annotation_of(i, i / 25, 1, track) for i, track in enumerate(frames))


@pytest.mark.parametrize("name", ["r.csv", "r.jsonl"])
def test_a_box_that_is_no_number_is_a_lost_target(tmp_path, name):
    broken = Track((math.nan, 2, 3, 4), score=math.nan, corners=np.full((4, 2), math.nan))
    (row,) = read_annotations(written(tmp_path / name, [[broken]]), SIZE, FPS).rows
    assert row == Annotation(0, 0.0, 1, (0.0, 0.0, 0.0, 0.0), None, 0.0, lost=True)
    assert row == annotation_of(0, 0.0, 1, broken)
    assert not row.seen


def test_frames_and_targets_may_be_left_out(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(csv_of({"frame": "7", "target": "2", "time": ""}, {"frame": "5"}) + "\n")
    read = read_annotations(path, SIZE, FPS, ["a", "b"])
    assert [(row.frame, row.target, row.time) for row in read.rows] == [(7, 2, None), (5, 1, 0.12)]
    assert (read.frame_count, read.names) == (8, ("a", "b"))
    assert {target: [row.frame for row in rows] for target, rows in read.tracks().items()} == {
        1: [5],
        2: [7],
    }


def test_a_table_without_rows_has_no_targets(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(csv_of())
    read = read_annotations(path, SIZE, FPS)
    assert (read.rows, read.names, read.frame_count) == ((), (), 0)


CSV_DAMAGES = [
    # name of the case, text of the file, words of the message
    ("empty", "", "line 1 names no column 'frame'"),
    ("no header", csv_of({}).split("\n", 1)[1], "line 1 names no column 'frame'"),
    ("column missing", csv_of({}).replace("lost", "found"), "line 1 names no column 'lost'"),
    ("web page", "<html>\n<body>\n", "line 1 names no column"),
    (
        "cut off",
        csv_of({}, {})[: -len("0,30,40,0.9,0,,,,,,,,,,,,,,")],
        "line 3: has 5 values where the header names 22",
    ),
    ("one too many", csv_of({}, {"x": "1,2"}), "line 3: has 23 values"),
    ("word", csv_of({"w": "wide"}), "line 2: w is 'wide', not a number"),
    ("long word", csv_of({"w": "w" * 99}), f"line 2: w is '{'w' * 40}', not a number"),
    ("not a number", csv_of({"x": "nan"}), "line 2: x is nan, which is out of range"),
    ("infinite", csv_of({"score": "-inf"}), "line 2: score is -inf, which is out of range"),
    ("huge", csv_of({"h": "1e300"}), "line 2: h is 1e+300, which is out of range"),
    ("half a frame", csv_of({"frame": "1.5"}), "line 2: frame is 1.5, not a whole number from 0"),
    ("no frame", csv_of({"frame": ""}), "line 2: frame is missing, not a whole number"),
    ("negative frame", csv_of({"frame": "-1"}), "line 2: frame is -1, not a whole number"),
    ("far frame", csv_of({"frame": "1e9"}), "line 2: frame is 1e+09, not a whole number"),
    ("target 0", csv_of({"target": "0"}), "line 2: target is 0, not a whole number from 1"),
    ("target 9999", csv_of({"target": "9999"}), "line 2: target is 9999, not a whole number"),
    ("half lost", csv_of({"lost": "2"}), "line 2: lost is 2, not a whole number from 0 to 1"),
    ("twice", csv_of({}, {"x": "11"}), "line 3: target 1 is in frame 3 a second time"),
    ("long line", csv_of({"x": "0" * 4000}), "line 2 has over 2048 bytes"),
    ("no line", "x" * 5_000_000, "line 1 has over 2048 bytes"),
    ("bytes", csv_of({}).encode() + b"\xff\xfe\x00,\n", "line 3: is not text"),
]
JSON_DAMAGES = [
    ("cut off", '{"frame": 3, "ti', "line 1: is not JSON (Unterminated string"),
    ("list", "[1, 2]", "line 1: is not a JSON object"),
    ("no lost", '{"frame": 3}', "line 1: has no 'time'"),
    ("deep", "[" * 2000, "line 1: "),
    ("text", "X", "line 1: is not JSON"),
]


@pytest.mark.parametrize(
    ("suffix", "text", "words"),
    [pytest.param("csv", *case, id=f"csv {name}") for name, *case in CSV_DAMAGES]
    + [pytest.param("jsonl", *case, id=f"jsonl {name}") for name, *case in JSON_DAMAGES],
)
def test_damage_is_told_with_file_and_line(tmp_path, suffix, text, words):
    path = tmp_path / f"r.{suffix}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(AnnotationsError) as caught:
        read_annotations(path, SIZE, FPS)
    message = str(caught.value)
    assert message.startswith(f"{path}: {words}")
    assert "\n" not in message
    assert len(message) < len(str(path)) + 160


@pytest.mark.parametrize(
    ("value", "words"),
    [
        pytest.param('"12"', "x is '12', not a number", id="text"),
        pytest.param("[1]", "x is '[1]', not a number", id="list"),
        pytest.param("NaN", "x is nan, which is out of range", id="nan"),
        pytest.param("1" + "0" * 400, "int too large", id="huge whole number"),
    ],
)
def test_json_values_are_numbers(tmp_path, value, words):
    path = written(tmp_path / "r.jsonl", [[TRACKS["plain"]]])
    path.write_text(path.read_text().replace("10.123", value))
    with pytest.raises(AnnotationsError) as caught:
        read_annotations(path, SIZE, FPS)
    assert str(caught.value).startswith(f"{path}: line 1: {words}")


def test_the_number_of_lines_is_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("ssiam.exchange.result_lines._MOST_LINES", 3)
    path = tmp_path / "r.csv"
    path.write_text(csv_of({"frame": "0"}, {"frame": "1"}))
    assert len(read_annotations(path, SIZE, FPS).rows) == 2
    path.write_text(csv_of({"frame": "0"}, {"frame": "1"}, {"frame": "2"}))
    with pytest.raises(AnnotationsError, match="line 4: no more can be read"):
        read_annotations(path, SIZE, FPS)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        pytest.param("none.csv", "cannot be read (No such file", id="absent"),
        pytest.param("folder.csv", "cannot be read (Is a directory", id="folder"),
        pytest.param("r.txt", "unknown kind of results; give a .csv", id="another kind"),
    ],
)
def test_other_files_are_refused(tmp_path, name, words):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "r.txt").write_text("1,2,3,4\n")
    with pytest.raises(AnnotationsError) as caught:
        read_annotations(tmp_path / name, SIZE, FPS)
    assert str(caught.value).startswith(f"{tmp_path / name}: {words}")


@pytest.mark.parametrize(
    ("size_wh", "fps", "names", "words"),
    [
        pytest.param((0, 96), 25, ["a"], "is no size of frames", id="no width"),
        pytest.param(SIZE, 0, ["a"], "frame rate 0 is not", id="no rate"),
        pytest.param(SIZE, math.inf, ["a"], "frame rate inf is not", id="infinite rate"),
        pytest.param(SIZE, math.nan, ["a"], "frame rate nan is not", id="nan rate"),
        pytest.param(SIZE, 25, ["a", "b"], "2 names for the 1 targets", id="names"),
        pytest.param(SIZE, 25, [], "0 names for the 1 targets", id="no names"),
    ],
)
def test_impossible_arguments(tmp_path, size_wh, fps, names, words):
    path = written(tmp_path / "r.csv", [[TRACKS["plain"]]])
    with pytest.raises(ArgumentError, match=words):
        read_annotations(path, size_wh, fps, names)


def test_every_target_needs_a_name():
    row = Annotation(0, None, 2, (1.0, 2.0, 3.0, 4.0))
    with pytest.raises(ArgumentError, match="1 names for 2 targets"):
        Annotations(SIZE, 25, ("a",), (row,))


def test_the_length_may_be_more_than_what_rows_tell():
    row = Annotation(4, None, 1, (1.0, 2.0, 3.0, 4.0))
    assert Annotations(SIZE, 25, ("a",), (row,)).frame_count == 5
    assert Annotations(SIZE, 25, ("a",), (row,), length=9).frame_count == 9
    assert Annotations(SIZE, 25, ("a",), (row,), length=2).frame_count == 5


def test_names_without_what_formats_cannot_hold():
    names = ("boat\n\x00\ud800", "", "Müller 船")
    annotations = Annotations(SIZE, 25, names, ())
    shown = [annotations.name(target) for target in (1, 2, 3)]
    assert shown == ["boat\ufffd\ufffd\ufffd", "target 2", "Müller 船"]
