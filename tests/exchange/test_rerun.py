"""`RerunLog`: .rrd files read back through Rerun's reader."""

from __future__ import annotations

import os
import subprocess
import sys

import cv2
import numpy as np
import pytest

from ssiam.errors import ArgumentError, MissingExtraError, SinkError
from ssiam.exchange import RerunLog
from ssiam.geometry import corners_from_xywh, rigid
from ssiam.motion import Motion
from ssiam.track import Track

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'ssiam[rerun]'")

COUNT, SIZE = 30, (160, 96)
IMAGE = np.dstack([np.full((96, 160), value, np.uint8) for value in (40, 120, 200)])


def moving(frame):
    motion = Motion(rigid(3.0 + frame, -2.0, 0.01, (79.5, 47.5)), 0.75, True, SIZE)
    return Track((10.0 + frame, 20.0, 30.0, 40.0), score=frame / COUNT, motion=motion)


def blinking(frame):
    box = (1.0, 2.0, 3.0, 4.0)
    return Track(box, score=0.5, lost=frame % 3 == 2, corners=corners_from_xywh(box))


def read(path):
    """Rows of every entity: {entity: {frame: {column: value}}}."""
    reader = pytest.importorskip("rerun.chunk").RrdReader(path)
    assert len(reader.recordings()) == 1
    found = {}
    for chunk in reader.stream():
        batch = chunk.to_record_batch()
        wanted = [name for name in batch.schema.names if name == "time" or ":" in name]
        if "frame" not in batch.schema.names:
            continue
        columns = {name: batch[name] for name in wanted}
        if "time" in columns:
            columns["time"] = columns["time"].cast("int64")
        rows = zip(*(column.to_pylist() for column in columns.values()), strict=True)
        for frame, row in zip(batch["frame"].to_pylist(), rows, strict=True):
            found.setdefault(chunk.entity_path, {})[frame] = dict(zip(columns, row, strict=True))
    return found


def numbers(rows):
    """The scalars of an entity in the order of frames."""
    return [rows[frame]["Scalars:scalars"][0] for frame in sorted(rows)]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("rerun") / "a b%é.rrd"
    with RerunLog(path) as log:
        for frame in range(COUNT):
            tracks = [moving(frame), blinking(frame)]
            time = None if frame == 7 else frame / 25
            log.write(frame, time, IMAGE, tracks, ["boat", "crew"], ids=[1, 5])
    return read(path)


def test_entities(recording):
    assert set(recording) == {
        *("/camera/image", "/camera/targets", "/camera/outlines"),
        *("/motion/dx", "/motion/dy", "/motion/angle"),
        *(f"/targets/{number}/{name}" for number in (1, 5) for name in ("score", "lost")),
    }
    for entity, rows in recording.items():
        assert sorted(rows) == list(range(COUNT)), entity


def test_times(recording):
    rows = recording["/targets/1/score"]
    assert rows[7].get("time") is None
    seconds = [rows[frame]["time"] / 1e9 for frame in rows if frame != 7]
    assert seconds == pytest.approx([frame / 25 for frame in rows if frame != 7], abs=1e-6)


def test_scalars(recording):
    assert numbers(recording["/targets/1/score"]) == pytest.approx(
        [frame / COUNT for frame in range(COUNT)]
    )
    assert numbers(recording["/targets/1/lost"]) == [0.0] * COUNT
    assert numbers(recording["/targets/5/lost"]) == [0.0, 0.0, 1.0] * 10
    assert numbers(recording["/motion/dx"]) == pytest.approx(list(range(3, 3 + COUNT)))
    assert numbers(recording["/motion/dy"]) == pytest.approx([-2.0] * COUNT)
    assert numbers(recording["/motion/angle"]) == pytest.approx([0.01] * COUNT)


def test_boxes(recording):
    both, one = (recording["/camera/targets"][frame] for frame in (4, 5))
    assert both["Boxes2D:centers"] == [[14 + 15, 20 + 20], [1 + 1.5, 2 + 2]]
    assert both["Boxes2D:half_sizes"] == [[15, 20], [1.5, 2]]
    assert both["Boxes2D:labels"] == ["boat", "crew"]
    assert both["Boxes2D:class_ids"] == [1, 5]
    assert one["Boxes2D:centers"] == [[15 + 15, 20 + 20]]
    assert one["Boxes2D:labels"] == ["boat"]


def test_outlines_are_closed_and_removed_when_lost(recording):
    visible, lost = (recording["/camera/outlines"][frame] for frame in (4, 5))
    assert visible["LineStrips2D:strips"] == [[[1, 2], [4, 2], [4, 6], [1, 6], [1, 2]]]
    assert visible["LineStrips2D:class_ids"] == [5]
    assert lost["LineStrips2D:strips"] == []


def test_images(recording):
    row = recording["/camera/image"][3]
    assert row["EncodedImage:media_type"] == ["image/jpeg"]
    decoded = cv2.imdecode(np.array(row["EncodedImage:blob"][0], np.uint8), cv2.IMREAD_COLOR)
    assert decoded.shape == IMAGE.shape
    assert np.abs(decoded.astype(int) - IMAGE).max() <= 3


def test_without_targets_and_motion(tmp_path):
    path = tmp_path / "r.rrd"
    with RerunLog(path) as log:
        log.write(0, None, IMAGE, [blinking(0)], ["boat"])
        log.write(1, None, IMAGE, [], [])
    rows = read(path)
    assert set(rows["/camera/image"]) == {0, 1}
    assert rows["/camera/targets"][1]["Boxes2D:labels"] == []
    assert set(rows["/targets/1/lost"]) == {0}
    assert "/motion/dx" not in rows


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_file_is_complete_after_an_exception(tmp_path, error):
    path = tmp_path / "r.rrd"
    log = RerunLog(path)

    def fail():
        with log:
            log.write(0, 0.0, IMAGE, [moving(0)], ["boat"])
            raise error("failed while logging")

    with pytest.raises(error, match="failed while logging"):
        fail()
    assert numbers(read(path)["/targets/1/score"]) == [0.0]
    log.close()


def test_existing_file_is_kept_until_new_one_is_complete(tmp_path):
    path = tmp_path / "r.rrd"
    path.write_text("older")
    with pytest.raises(SinkError, match="exists already"):
        RerunLog(path, overwrite=False)
    with RerunLog(path) as log:
        log.write(0, 0.0, IMAGE, [moving(0)], ["boat"])
        assert path.read_text() == "older"
        assert (tmp_path / "r.part.rrd").exists()
    assert numbers(read(path)["/targets/1/score"]) == [0.0]
    assert [each.name for each in tmp_path.iterdir()] == ["r.rrd"]


def test_number_of_names_and_ids_must_match_tracks(tmp_path):
    with RerunLog(tmp_path / "r.rrd") as log:
        with pytest.raises(ArgumentError, match="1 tracks with 0 names and 1 ids"):
            log.write(0, 0.0, IMAGE, [moving(0)], [])
        with pytest.raises(ArgumentError, match="1 tracks with 1 names and 2 ids"):
            log.write(0, 0.0, IMAGE, [moving(0)], ["boat"], ids=[1, 2])


@pytest.mark.parametrize(
    ("name", "words"),
    [
        pytest.param("none/r.rrd", "there is no folder", id="no folder"),
        pytest.param("folder.rrd", "is a folder", id="folder"),
        pytest.param("r.mp4", "is written as .rrd", id="another kind"),
    ],
)
def test_unwritable_file_raises_sink_error(tmp_path, name, words):
    (tmp_path / "folder.rrd").mkdir()
    with pytest.raises(SinkError, match=words):
        RerunLog(tmp_path / name)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
def test_full_disk_raises_sink_error_and_does_not_hang(tmp_path):
    """In a separate process: the SDK alone would keep it from exiting."""
    (tmp_path / "r.rrd").symlink_to("/dev/full")
    code = (
        "import sys, numpy as np; from ssiam.exchange import RerunLog\n"
        "log = RerunLog(sys.argv[1])\n"
        "noise = np.random.default_rng(1).integers(0, 256, (480, 640, 3)).astype(np.uint8)\n"
        "for frame in range(200): log.write(frame, None, noise, [], [])\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "r.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("ssiam.errors.SinkError: ")
    assert "No space left on device" in last


def test_missing_sdk_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'ssiam\[rerun\]'$"):
        RerunLog(tmp_path / "r.rrd")


def test_no_viewer_and_no_port(tmp_path):
    psutil = pytest.importorskip("psutil")
    before = psutil.Process()
    children, ports = before.children(), before.net_connections()
    with RerunLog(tmp_path / "r.rrd") as log:
        log.write(0, 0.0, IMAGE, [moving(0)], ["boat"])
        assert before.children() == children
        assert before.net_connections() == ports
