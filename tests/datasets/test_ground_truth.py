"""Ground truth files: valid and damaged content."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ssiam.datasets import DatasetError, parse_boxes, read_boxes

_COORDINATES = st.floats(-1e6, 1e6, allow_nan=False)
_SEPARATORS = st.sampled_from([",", "\t", " ", ", ", " , ", ",\t"])


@given(
    rows=st.sampled_from([4, 8]).flatmap(
        lambda n: st.lists(st.tuples(*[_COORDINATES] * n), min_size=1, max_size=20)
    ),
    separator=_SEPARATORS,
    newline=st.sampled_from(["\n", "\r\n", "\n\n"]),
)
def test_written_boxes_are_read_back(rows, separator, newline):
    written = newline.join(separator.join(map(repr, row)) for row in rows)
    assert np.array_equal(parse_boxes(written, Path("t.txt")), np.array(rows))


VALID = [
    ("tabs with one line of spaces", "1\t2\t3\t4\n5 6 7 8\n", [[1, 2, 3, 4], [5, 6, 7, 8]]),
    ("trailing comma and spaces", " 1,2,3,4, \n", [[1, 2, 3, 4]]),
    ("unknown frame", "1,2,3,4\nNaN,NaN,NaN,NaN\n", [[1, 2, 3, 4], [np.nan] * 4]),
    ("byte order mark", "\ufeff1,2,3,4", [[1, 2, 3, 4]]),
    (
        "box among polygons",
        "1,2,3,4\n0,0,9,0,9,9,0,9",
        [[1, 2, 4, 2, 4, 6, 1, 6], [0, 0, 9, 0, 9, 9, 0, 9]],
    ),
]


@pytest.mark.parametrize(("content", "expected"), [r[1:] for r in VALID], ids=[r[0] for r in VALID])
def test_published_formats_are_read(tmp_path, content, expected):
    path = tmp_path / "groundtruth.txt"
    path.write_text(content, encoding="utf-8")
    assert np.array_equal(read_boxes(path), np.array(expected, float), equal_nan=True)


DAMAGED = [
    ("empty", "", "has no boxes"),
    ("only blank lines", "\n \n\t\n", "has no boxes"),
    ("words", "1,2,3,4\nleft,top,w,h\n", "line 2 is 'left,top,w,h', not 4 or 8 numbers"),
    ("three numbers", "1,2,3\n", "line 1 is '1,2,3'"),
    ("missing number", "1,,3,4\n", "line 1"),
    ("infinity", "1,2,3,1e999\n", "line 1"),
    ("very long line", "9" * 100_000, "not 4 or 8 numbers"),
    ("binary", "\x00\xff\x01", "line 1"),
    ("HTML", "<html>not found</html>", "line 1 is '<html>"),
]


@pytest.mark.parametrize(
    ("content", "message"), [r[1:] for r in DAMAGED], ids=[r[0] for r in DAMAGED]
)
def test_damage_is_an_error_of_one_line_with_the_file(tmp_path, content, message):
    path = tmp_path / "groundtruth.txt"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(DatasetError) as caught:
        read_boxes(path)
    line = str(caught.value)
    assert message in line
    assert line.startswith(str(path))
    assert "\n" not in line
    assert len(line) < len(str(path)) + 120


@given(st.text(max_size=200))
def test_any_text_gives_boxes_or_a_dataset_error(content):
    with suppress(DatasetError):
        assert parse_boxes(content, Path("t.txt")).shape[1] in (4, 8)


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "groundtruth.txt"
    with path.open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(DatasetError, match="has more than 2097152 bytes"):
        read_boxes(path)


def test_a_folder_is_not_a_box_file(tmp_path):
    with pytest.raises(DatasetError, match="no such file"):
        read_boxes(tmp_path)
