"""Result files: contents of every format, and behavior on errors."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import subprocess

import numpy as np
import pytest

from helpers.video_clips import python
from ssiam.errors import SinkError
from ssiam.geometry import rigid
from ssiam.motion import Motion
from ssiam.track import Track
from ssiam.video import open_results

PLAIN = Track((10.123456, 20.0, 30.5, 40.25), score=0.98765)
ROTATED = Track(
    (0.1 + 0.2, 1.0, 5.0, 6.0),
    score=0.5,
    corners=np.array([[0.0, 1.0], [5.0, 1.5], [4.5, 7.0], [-0.5, 6.0]]),
    motion=Motion(rigid(3.0, -2.0, 0.01, (79.5, 47.5)), 0.75, True, (160, 96)),
)
LOST = Track((1.0, 2.0, 3.0, 4.0), score=0.01, lost=True)
NOT_FINITE = Track(
    (math.nan, 2.0, math.inf, 4.0), score=math.nan, corners=np.full((4, 2), math.nan)
)


def _write(path, frames, **kwargs):
    with open_results(path, targets=len(frames[0]), **kwargs) as sink:
        for index, tracks in enumerate(frames):
            sink.write(index, index / 25 if index else None, tracks)
    return path


def test_csv_columns(tmp_path):
    path = _write(tmp_path / "r.csv", [[PLAIN, LOST], [ROTATED, LOST]])
    rows = list(csv.DictReader(path.open()))
    assert [(r["frame"], r["time"], r["target"]) for r in rows] == [
        ("0", "", "1"),
        ("0", "", "2"),
        ("1", "0.04", "1"),
        ("1", "0.04", "2"),
    ]
    first, lost, rotated = rows[:3]
    assert [first[k] for k in "xywh"] == ["10.123", "20", "30.5", "40.25"]
    assert (first["score"], first["lost"], lost["lost"]) == ("0.9877", "0", "1")
    assert {first[f"{axis}{n}"] for axis in "xy" for n in (1, 2, 3, 4)} == {""}
    assert first["dx"] == first["reliable"] == ""
    assert rotated["x"] == "0.3"
    assert [rotated[k] for k in ("x2", "y2", "x4", "y4")] == ["5", "1.5", "-0.5", "6"]
    assert [rotated[k] for k in ("dx", "dy", "angle_rad")] == ["3", "-2", "0.01"]
    assert (rotated["inliers"], rotated["reliable"]) == ("0.75", "1")


def test_jsonl_has_columns_of_csv(tmp_path):
    lines = _write(tmp_path / "r.jsonl", [[PLAIN], [ROTATED]]).read_text().splitlines()
    header = next(csv.reader(_write(tmp_path / "r.csv", [[PLAIN]]).open()))
    plain, rotated = map(json.loads, lines)
    assert list(plain) == list(rotated) == header
    assert plain["x1"] is None
    assert plain["time"] is None
    assert plain["lost"] is False
    assert rotated["y4"] == 6.0
    assert rotated["angle_rad"] == pytest.approx(0.01)


def test_mot_is_one_based_and_omits_lost_targets(tmp_path):
    path = _write(tmp_path / "r.txt", [[PLAIN, LOST], [LOST, ROTATED]], layout="mot")
    assert path.read_text().splitlines() == [
        "1,1,11.123,21,30.5,40.25,0.9877,-1,-1,-1",
        "2,2,1.3,2,5,6,0.5,-1,-1,-1",
    ]


def test_otb_is_one_based_with_one_line_per_frame(tmp_path):
    path = _write(tmp_path / "r.txt", [[PLAIN], [LOST], [ROTATED]])
    assert path.read_text() == "11.123,21,30.5,40.25\n2,3,3,4\n1.3,2,5,6\n"


def test_vot_starts_with_1_and_writes_polygons(tmp_path):
    path = _write(tmp_path / "r.txt", [[PLAIN], [LOST], [ROTATED]], layout="vot")
    assert path.read_text() == "1\n1,2,3,4\n0,1,5,1.5,4.5,7,-0.5,6\n"


@pytest.mark.parametrize("layout", ["otb", "vot"])
def test_one_file_per_target(tmp_path, layout):
    _write(tmp_path / "r.txt", [[PLAIN, LOST, ROTATED]] * 2, layout=layout)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r_1.txt", "r_2.txt", "r_3.txt"]
    assert {len(p.read_text().splitlines()) for p in tmp_path.iterdir()} == {2}
    second = (tmp_path / "r_2.txt").read_text().splitlines()
    assert second == {"otb": ["2,3,3,4"] * 2, "vot": ["1", "1,2,3,4"]}[layout]


@pytest.mark.parametrize("name", ["r.csv", "r.jsonl", "otb.txt", "vot.txt", "mot.txt"])
def test_nan_and_inf_are_never_written(tmp_path, name):
    layout = name[:3] if name.endswith("txt") else None
    text = _write(tmp_path / name, [[PLAIN], [NOT_FINITE]], layout=layout).read_text()
    assert "nan" not in text.lower()
    assert "inf" not in text.lower().replace("inliers", "")
    if layout == "otb":
        assert text.splitlines()[1] == "0,0,0,0"


def test_values_are_rounded_without_negative_zero(tmp_path):
    track = Track((-0.0001, 1e-9, 1 / 3, 1e7 + 1 / 3), score=1.0)
    row = _write(tmp_path / "r.csv", [[track]]).read_text().splitlines()[1].split(",")
    assert row[3:8] == ["0", "0", "0.333", "10000000.333", "1"]


REFUSED = [
    # name of the case, path, layout, words of the message
    ("no folder", "none/r.csv", None, "there is no folder"),
    ("folder", "folder.csv", None, "is a folder"),
    ("unknown kind", "r.xml", None, "unknown kind of results"),
    ("layout for csv", "r.csv", "mot", "no layout 'mot'"),
    ("unknown layout", "r.txt", "coco", "no layout 'coco'"),
]


@pytest.mark.parametrize(
    ("name", "layout", "words"), [r[1:] for r in REFUSED], ids=[r[0] for r in REFUSED]
)
def test_unwritable_results_are_refused_on_opening(tmp_path, name, layout, words):
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(SinkError, match=words) as caught:
        open_results(tmp_path / name, layout=layout)
    assert str(caught.value).startswith(str(tmp_path / name))


def test_wrong_number_of_tracks_is_refused(tmp_path):
    sink = open_results(tmp_path / "r.csv", targets=2)
    with sink, pytest.raises(ValueError, match="1 tracks for 2 targets"):
        sink.write(0, None, [PLAIN])


def test_existing_results_are_replaced(tmp_path):
    (tmp_path / "r.txt").write_text("old\n" * 100)
    assert _write(tmp_path / "r.txt", [[LOST]]).read_text() == "2,3,3,4\n"


def test_existing_results_are_kept_until_new_ones_are_complete(tmp_path):
    (tmp_path / "r.csv").write_text("old\n")
    (tmp_path / "r.csv").chmod(0o640)
    with open_results(tmp_path / "r.csv") as sink:
        sink.write(0, None, [PLAIN])
        assert (tmp_path / "r.csv").read_text() == "old\n"
        assert sink.locations == (tmp_path / "r.part.csv",)
    assert len((tmp_path / "r.csv").read_text().splitlines()) == 2
    assert (tmp_path / "r.csv").stat().st_mode & 0o777 == 0o640
    assert [path.name for path in tmp_path.iterdir()] == ["r.csv"]


def test_existing_results_are_refused_without_overwrite(tmp_path):
    (tmp_path / "r_2.txt").write_text("old\n")
    with pytest.raises(SinkError, match=r"r_2\.txt: exists already"):
        open_results(tmp_path / "r.txt", targets=2, overwrite=False)
    assert [path.name for path in tmp_path.iterdir()] == ["r_2.txt"]


def test_symlink_is_kept_and_its_target_replaced(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "o.csv").write_text("old\n")
    (tmp_path / "r.csv").symlink_to("elsewhere/o.csv")
    _write(tmp_path / "r.csv", [[PLAIN]])
    assert (tmp_path / "r.csv").is_symlink()
    assert len((tmp_path / "elsewhere" / "o.csv").read_text().splitlines()) == 2


def test_results_to_named_pipe(tmp_path):
    os.mkfifo(tmp_path / "r.csv")
    reader = subprocess.Popen(["cat", str(tmp_path / "r.csv")], stdout=subprocess.PIPE, text=True)
    _write(tmp_path / "r.csv", [[PLAIN], [LOST]])
    assert len(reader.communicate(timeout=60)[0].splitlines()) == 3
    assert [path.name for path in tmp_path.iterdir()] == ["r.csv"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("name", ["r.csv", "r.txt"])
def test_full_disk_raises_sink_error(tmp_path, name):
    (tmp_path / name).symlink_to("/dev/full")
    with pytest.raises(SinkError, match=rf"{name}: cannot be written \(No space"):
        _write(tmp_path / name, [[PLAIN]])


_FULL_DISK = """
import resource, signal, sys
from ssiam.errors import SinkError
from ssiam.track import Track
from ssiam.video import open_results
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (105, 105))
try:
    with open_results(sys.argv[1]) as sink:
        for index in range(99):
            sink.write(index, None, [Track((10, 20, 30, 40))])
except SinkError as error:
    print(error)
"""


def test_full_disk_leaves_complete_lines(tmp_path):
    (tmp_path / "r.txt").write_text("older\n")
    process = python(_FULL_DISK, str(tmp_path / "r.txt"), stdout=subprocess.PIPE)
    message = process.communicate()[0].decode()
    assert message.endswith(f"; what was written is in {tmp_path / 'r.part.txt'}\n")
    assert (tmp_path / "r.part.txt").read_text() == "11,21,30,40\n" * 8
    assert (tmp_path / "r.txt").read_text() == "older\n"


_WRITE_FOREVER = """
import sys
from ssiam.track import Track
from ssiam.video import open_results
with open_results(sys.argv[1]) as sink:
    for index in range(10**6):
        sink.write(index, index / 25, [Track((10, 20, 30, 40))])
        print(index, flush=True)
"""


def test_killed_writer_leaves_complete_lines(tmp_path):
    path = tmp_path / "r.part.jsonl"
    process = python(_WRITE_FOREVER, str(tmp_path / "r.jsonl"), stdout=subprocess.PIPE)
    for line in process.stdout:
        if int(line) >= 200:
            process.send_signal(signal.SIGKILL)
            break
    process.stdout.close()
    process.wait()
    frames = [json.loads(line)["frame"] for line in path.read_text().splitlines()]
    assert frames == list(range(len(frames)))
    assert len(frames) >= 200
