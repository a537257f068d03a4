"""The forms of ``--box``: words, times, and files of boxes."""

import pytest

from ssiam.cli.box_words import join_box_words
from ssiam.cli.boxes import parse_boxes
from ssiam.errors import ArgumentError

BOX = (120.0, 80.0, 40.0, 60.0)


def begins(text):
    (target,) = parse_boxes([text])
    assert target.xywh == BOX
    return None if target.begins is None else (target.begins.frame, target.begins.seconds)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("120,80,40,60", None),
        (" 120, 80 ,4e1,60.0", None),
        ("300:120,80,40,60", (300, None)),
        ("12s:120,80,40,60", (None, 12.0)),
        (".5s:120,80,40,60", (None, 0.5)),
        ("0:12:120,80,40,60", (None, 12.0)),
        ("1:02:03.5:120,80,40,60", (None, 3723.5)),
    ],
)
def test_forms(text, expected):
    assert begins(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        *("", "1,2,3", "1,2,3,4,5", "a,b,c,d", "1;2;3;4", ":1,2,3,4", "-3:1,2,3,4"),
        *("1.5:1,2,3,4", "nans:1,2,3,4", "0:60:1,2,3,4", "1:60:00:1,2,3,4", "12 s:1,2,3,4"),
        *("0:0:0:1:1,2,3,4", "9999999999999999:1,2,3,4"),
    ],
)
def test_other_texts_are_refused_in_one_line(text):
    with pytest.raises(ArgumentError) as raised:
        parse_boxes([text])
    assert repr(text) in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("words", "joined"),
    [
        ("clip --box 1 2 3 4", "clip --box 1,2,3,4"),
        ("--box 1 2 3 4 clip", "--box 1,2,3,4 clip"),
        ("--box=1 2 3 4 --box -5 6.5 7 8 0", "--box=1,2,3,4 --box -5,6.5,7,8 0"),
        ("clip --box 12s:1 2 3 4", "clip --box 12s:1,2,3,4"),
        ("clip --box 1,2,3,4 5 6 7", "clip --box 1,2,3,4 5 6 7"),
        ("clip --box 1 2 3", "clip --box 1 2 3"),
        ("clip --box 1 2 3 x", "clip --box 1 2 3 x"),
        ("clip --box", "clip --box"),
        ("clip -- --box 1 2 3 4", "clip -- --box 1 2 3 4"),
        ("clip --out 1 2 3 4", "clip --out 1 2 3 4"),
    ],
)
def test_four_words(words, joined):
    assert join_box_words(words.split()) == joined.split()


@pytest.fixture
def boxes_of(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def parse(content):
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / "b.csv").write_bytes(data)
        found = parse_boxes(["@b.csv"])
        return [(each.xywh, each.begins and each.begins.text) for each in found]

    return parse


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        pytest.param("1,2,3,4\n5,6,7,8\n", [None, None], id="no header"),
        pytest.param("x,y,w,h\n1,2,3,4\n5,6,7,8", [None, None], id="header"),
        pytest.param("\ufeffX, Y, W, H\r\n\r\n1, 2, 3, 4\r\n5,6,7,8\r\n", [None, None], id="excel"),
        pytest.param(
            "name,w,h,x,y,frame\na,3,4,1,2,\nb,7,8,5,6,30\n", [None, "30"], id="other order"
        ),
        pytest.param("time,x,y,w,h\n1.5,1,2,3,4\n0:12,5,6,7,8\n", ["1.5s", "0:12"], id="times"),
        pytest.param(
            "frame,time,x,y,w,h\n7,,1,2,3,4\n,2s,5,6,7,8\n", ["7", "2s"], id="frame or time"
        ),
    ],
)
def test_files(boxes_of, content, expected):
    found = boxes_of(content)
    assert [box for box, _ in found] == [(1, 2, 3, 4), (5, 6, 7, 8)]
    assert [begins for _, begins in found] == expected


@pytest.mark.parametrize(
    ("content", "named"),
    [
        pytest.param("", "has no box", id="empty"),
        pytest.param("x,y,w,h\n", "has no box", id="header alone"),
        pytest.param("1,2,3,4\n1,2,3\n", "line 2: has 3 values", id="short"),
        pytest.param("1,2,3,4\n\n1,b,3,4\n", "line 3: y is 'b'", id="no number"),
        pytest.param("x,y,w,h\n1,2,nan,4\n", "line 2: w is 'nan'", id="nan"),
        pytest.param("x,y,w,h\n1,2,3,inf\n", "line 2: h is 'inf'", id="infinite"),
        pytest.param("x,y,w\n1,2,3\n", "line 1: 'x,y,w' has no column h", id="no column"),
        pytest.param("frame,x,y,w,h\n-3,1,2,3,4\n", "line 2: frame is '-3'", id="frame"),
        pytest.param("frame,x,y,w,h\n2s,1,2,3,4\n", "line 2: frame is '2s'", id="time as frame"),
        pytest.param("time,x,y,w,h\nnoon,1,2,3,4\n", "line 2: time is 'noon'", id="time"),
        pytest.param("frame,time,x,y,w,h\n1,1,1,2,3,4\n", "line 2: has both", id="both"),
        pytest.param(b"\xff\xfe\x00\x01", "line 1", id="binary"),
        pytest.param("1,2,3,4\n" * 1001, "line 1001: over 1000", id="rows of results"),
        pytest.param("1,2,3,4\n" * 200_000, "larger than 1 MiB", id="large"),
    ],
)
def test_damaged_files_name_the_line(boxes_of, content, named):
    with pytest.raises(ArgumentError) as raised:
        boxes_of(content)
    assert named in str(raised.value)
    assert "b.csv" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_missing_file_and_folder(tmp_path):
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(ArgumentError, match="cannot be read"):
            parse_boxes([f"@{path}"])
