"""Every program in examples/ runs as a user runs it, on a decoded file or over the network."""

from __future__ import annotations

import csv
import itertools
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.ground_station import ACTIVE, GroundStation
from helpers.rtsp import RtspServer, missing_rtsp
from helpers.shaky_clip import write_clip
from ssiam.geometry import iou
from ssiam.video import VideoSink, open_source

EXAMPLES = Path(__file__).parents[1] / "examples"
CLIP = EXAMPLES / "shaky-walker.mp4"
BOX = "53,114,26,66"
OTHER_BOX = "470,90,30,70"
# Programs that belong to the demo clip.
OF_THE_CLIP = {"demo.py", "make_clip.py"}
PROGRAMS = sorted({path.name for path in EXAMPLES.glob("*.py")} - OF_THE_CLIP)
SECONDS = 120


@pytest.fixture(scope="module")
def truth():
    """The walker's boxes (117, 4)."""
    return np.loadtxt(EXAMPLES / "shaky-walker.txt", delimiter=",")


@pytest.fixture
def run(tmp_path):
    def run(program, *arguments):
        done = subprocess.run(
            [sys.executable, EXAMPLES / program, *map(str, arguments)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=SECONDS,
        )
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout

    return run


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_is_short_tested_and_listed(program):
    assert len((EXAMPLES / program).read_text(encoding="utf-8").splitlines()) <= 40
    assert f'"{program}"' in Path(__file__).read_text(encoding="utf-8")
    assert f"`{program}`" in (EXAMPLES / "README.md").read_text(encoding="utf-8")


def printed_boxes(text):
    """Frame numbers and boxes of printed tracks."""
    rows = re.findall(r"^(\d+) Track\(box=\((.*?)\)", text, re.MULTILINE)
    return {int(frame): [float(v) for v in box.split(",")] for frame, box in rows}


def overlaps(boxes, truth):
    return np.array([iou(box, truth[frame]) for frame, box in boxes.items()])


def test_a_given_motion_keeps_the_target(run, truth):
    motion = EXAMPLES / "shaky-walker-motion.csv"
    boxes = printed_boxes(run("given_motion.py", CLIP, BOX, motion))
    assert list(boxes) == list(range(1, 117))
    assert (overlaps(boxes, truth) > 0.5).mean() > 0.9


def test_an_own_tracker_runs_on_the_stabilized_view(run, tmp_path):
    path = tmp_path / "clip.mp4"
    truth = write_clip(path, 60)
    box = ",".join(map(str, truth[0]))
    boxes = printed_boxes(run("own_tracker.py", path, box))
    assert list(boxes) == list(range(1, 60))
    assert overlaps(boxes, truth).min() > 0.5


def test_the_loop_of_opencv_draws_the_box(run, tmp_path):
    run("opencv_loop.py", CLIP, BOX, tmp_path / "out.avi")
    with open_source(CLIP) as plain, open_source(tmp_path / "out.avi") as drawn:
        pairs = [(a.image, b.image) for a, b in zip(plain, drawn, strict=True)]
    assert len(pairs) == 117
    green = [int((b.astype(int) - a)[..., 1].max()) for a, b in pairs[1:]]
    assert min(sorted(green)[20:]) > 60


def test_supervision_draws_the_targets(run, tmp_path):
    run("supervision_overlay.py", CLIP, tmp_path / "out.mp4", BOX, OTHER_BOX)
    with open_source(CLIP) as plain, open_source(tmp_path / "out.mp4") as drawn:
        differ = [
            np.abs(a.image.astype(int) - b.image).max() for a, b in zip(plain, drawn, strict=True)
        ]
    assert len(differ) == 117
    assert min(differ[1:]) > 80


def test_several_targets_get_video_and_rows(run, tmp_path, truth):
    run("several_targets.py", CLIP, "out.mp4", "out.csv", BOX, OTHER_BOX)
    with (tmp_path / "out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(int(row["frame"]), row["target"]) for row in rows] == list(
        itertools.product(range(1, 117), "12")
    )
    walker = {
        int(row["frame"]): [float(row[name]) for name in "xywh"]
        for row in rows
        if row["target"] == "1"
    }
    assert (overlaps(walker, truth) > 0.5).mean() > 0.9
    assert len(list(open_source(tmp_path / "out.mp4"))) == 117


def test_a_hidden_target_is_reported_as_lost_and_found(run, tmp_path):
    hidden = range(30, 50)
    boxes = write_clip(tmp_path / "clip.mp4", 80, hidden=hidden)
    lines = run("lost_and_found.py", "clip.mp4", ",".join(map(str, boxes[0])), "returns")
    lost, found = (int(number) for number in re.findall(r"^frame (\d+): ", lines, re.MULTILINE))
    assert lost in hidden
    assert hidden.stop <= found < hidden.stop + 10
    assert "lost\n" in lines
    assert f"found after {found - lost} frames" in lines
    assert cv2.imread(str(tmp_path / "returns" / f"{found:06d}.jpg")).shape == (240, 320, 3)


def test_the_cameras_motion_keeps_the_identity_of_detections(run, tmp_path, truth):
    rows = [f"{frame},{','.join(map(str, box))}" for frame, box in enumerate(truth)]
    (tmp_path / "boxes.csv").write_text("\n".join(["frame,x,y,w,h", *rows]))
    lines = run("detector_motion.py", CLIP, "boxes.csv").splitlines()
    assert [line.split()[:2] for line in lines] == [[str(frame), "1"] for frame in range(117)]
    still = [iou(a, b) for a, b in itertools.pairwise(truth)]
    assert np.mean(np.array(still) < 0.3) > 0.5  # without the motion most frames end it


@pytest.fixture
def rtsp(tmp_path):
    if reason := missing_rtsp():
        pytest.skip(reason)
    with open_source(CLIP) as frames, VideoSink(tmp_path / "clip.mp4", 25) as sink:
        for frame in frames:  # the server needs a clip without B-frames
            sink.write(frame.image)
    with RtspServer().start(tmp_path / "clip.mp4") as server:
        yield server.address


def mavlink_status(source, box):
    """The first status of a tracked target that the program sends for a source."""
    with GroundStation() as station:
        command = [sys.executable, EXAMPLES / "to_mavlink.py", source, box, station.address]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        try:
            return station.until(
                "CAMERA_TRACKING_IMAGE_STATUS", SECONDS, lambda s: s.tracking_status == ACTIVE
            )
        finally:
            process.terminate()
            process.wait()


def check_inside(status):
    assert 0 <= status.rec_top_x < status.rec_bottom_x <= 1
    assert 0 <= status.rec_top_y < status.rec_bottom_y <= 1


def test_a_file_is_sent_as_mavlink():
    check_inside(mavlink_status(CLIP, BOX))


def test_a_stream_is_sent_as_mavlink(rtsp):
    check_inside(mavlink_status(rtsp, BOX))
