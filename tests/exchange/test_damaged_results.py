"""Damaged results: the error is one line with file and line number."""

from __future__ import annotations

import pytest

from helpers.written_results import FPS, SIZE, TRACKS, csv_of, written
from ssiam.exchange import AnnotationsError, read_annotations
from ssiam.exchange.labelstudio import region_annotations

CSV_DAMAGES = [
    # name of the case, text of the file, words of the message
    ("empty", "", "line 1 has no column 'frame'"),
    ("no header", csv_of({}).split("\n", 1)[1], "line 1 has no column 'frame'"),
    ("column missing", csv_of({}).replace("lost", "found"), "line 1 has no column 'lost'"),
    ("web page", "<html>\n<body>\n", "line 1 has no column"),
    (
        "cut off",
        csv_of({}, {})[: -len("0,30,40,0.9,0,,,,,,,,,,,,,,")],
        "line 3: has 5 values, but the header has 23",
    ),
    ("one too many", csv_of({}, {"x": "1,2"}), "line 3: has 24 values"),
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
def test_error_names_file_and_line(tmp_path, suffix, text, words):
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
def test_json_values_must_be_numbers(tmp_path, value, words):
    path = written(tmp_path / "r.jsonl", [[TRACKS["plain"]]])
    path.write_text(path.read_text().replace("10.123", value))
    with pytest.raises(AnnotationsError) as caught:
        read_annotations(path, SIZE, FPS)
    assert str(caught.value).startswith(f"{path}: line 1: {words}")


def test_number_of_lines_is_limited(tmp_path, monkeypatch):
    monkeypatch.setattr("ssiam.exchange.result_files._MOST_LINES", 3)
    path = tmp_path / "r.csv"
    path.write_text(csv_of({"frame": "0"}, {"frame": "1"}))
    assert len(read_annotations(path, SIZE, FPS).rows) == 2
    path.write_text(csv_of({"frame": "0"}, {"frame": "1"}, {"frame": "2"}))
    with pytest.raises(AnnotationsError, match="line 4: over 3 lines"):
        read_annotations(path, SIZE, FPS)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        pytest.param("none.csv", "cannot be read (No such file", id="absent"),
        pytest.param("folder.csv", "cannot be read (Is a directory", id="folder"),
        pytest.param("r.txt", "unknown kind of results; give a .csv", id="another kind"),
    ],
)
def test_files_of_other_kinds_are_refused(tmp_path, name, words):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "r.txt").write_text("1,2,3,4\n")
    with pytest.raises(AnnotationsError) as caught:
        read_annotations(tmp_path / name, SIZE, FPS)
    assert str(caught.value).startswith(f"{tmp_path / name}: {words}")


@pytest.mark.parametrize("region", ["a text", 3, None, [], {}, {"value": "wide"}])
def test_a_region_of_label_studio_that_is_none(region):
    with pytest.raises(AnnotationsError, match="has no sequence"):
        region_annotations(region, SIZE, FPS)
