"""`ssiam track` with a truncated video or an interrupted run: earlier frames are kept."""

import signal
import subprocess
import sys
import time

import cv2
import pytest

from helpers.synthetic import world
from helpers.tracked_clip import BOX, COUNT, SIZE, box_of, decoded, rows_of, run, write_clip


def test_truncated_video_is_tracked_to_its_last_frame(tmp_path):
    write_clip(tmp_path / "whole.mkv")
    content = (tmp_path / "whole.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(content[: len(content) // 2])
    done = run("track", "cut.mkv", "--box", box_of(BOX), "--tracker", "kcf", cwd=tmp_path)
    assert done.returncode == 3
    assert done.stderr.startswith("ssiam: cut.mkv")
    assert done.stderr.count("\n") == 1
    rows = rows_of(tmp_path / "cut-tracked.csv")
    assert 5 < len(rows) < COUNT
    assert len(decoded(tmp_path / "cut-tracked.mp4")[0]) == len(rows)


def test_frames_before_a_size_change_are_kept(tmp_path):
    (tmp_path / "frames").mkdir()
    for index in range(8):
        size = SIZE if index < 6 else (160, 120)
        cv2.imwrite(str(tmp_path / "frames" / f"{index}.png"), world(size_wh=size))
    done = run("track", "frames", "--box", box_of(BOX), "--tracker", "kcf", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "160x120" in done.stderr
    assert len(rows_of(tmp_path / "frames-tracked.csv")) == 6
    assert len(decoded(tmp_path / "frames-tracked.mp4")[0]) == 6


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["ctrl-c", "terminated"]
)
def test_interrupted_run_leaves_complete_files(tmp_path, number, code):
    write_clip(tmp_path / "long.mp4", count=400)
    command = [sys.executable, "-m", "ssiam", "track", "long.mp4", "--box", box_of(BOX)]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    results, part = tmp_path / "long-tracked.csv", tmp_path / "long-tracked.part.csv"
    deadline = time.monotonic() + 60
    while not part.exists() or part.read_bytes().count(b"\n") < 15:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(number)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == code
    assert errors == ""
    assert "long-tracked.mp4" in output
    text = results.read_text()
    assert text.endswith("\n")
    rows = rows_of(results)
    assert 10 < len(rows) < 400
    assert None not in rows[-1].values()
    assert abs(len(decoded(tmp_path / "long-tracked.mp4")[0]) - len(rows)) <= 1
    assert not list(tmp_path.glob("*.part*"))
