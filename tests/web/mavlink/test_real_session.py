"""A ground station and a real session, over a real link."""

import re
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

import ssiam
from helpers.ground_station import ACCEPTED, ACTIVE, HERE, IDLE, RECTANGLE, STOP, free_port
from helpers.shaky_clip import write_clip
from ssiam.web.feeds.opening import open_feed
from ssiam.web.mavlink.camera import MavlinkCamera
from ssiam.web.recording import Recordings
from ssiam.web.session import Session

DOCUMENT = Path(__file__).parents[3] / "docs" / "how-to" / "mavlink.md"


@contextmanager
def running(path, address):
    """A real session on a clip in real time, as a camera."""
    feed = open_feed(str(path), pace="clock", notify=lambda note: None)
    session = Session(feed, ssiam.load_tracker("csrt"), "csrt", Recordings())
    steps = []
    session.listen(steps.append)
    with session, MavlinkCamera(session, address):
        yield steps


def test_a_ground_station_controls_a_real_session(tmp_path, station):
    boxes = write_clip(tmp_path / "clip.mp4", 120, fps=8)
    x, y, w, h = boxes[0]
    with running(tmp_path / "clip.mp4", station.address) as steps:
        station.status()
        x, y, w, h = boxes[steps[-1].frame.index]
        corners = x / 320, y / 240, (x + w) / 320, (y + h) / 240
        assert station.ask(RECTANGLE, *corners) == ACCEPTED
        statuses = [station.status(lambda s: s.tracking_status == ACTIVE) for _ in range(20)]
        assert station.ask(STOP) == ACCEPTED
        assert station.status(lambda s: s.tracking_status == IDLE)
    boxes_sent = [
        tuple(
            side / size
            for side, size in zip(step.targets[0].track.box, (320, 240) * 2, strict=True)
        )
        for step in steps
        if step.targets
    ]
    for status in statuses:
        left, top = status.rec_top_x, status.rec_top_y
        box = (left, top, status.rec_bottom_x - left, status.rec_bottom_y - top)
        assert box in [pytest.approx(each, abs=1e-4) for each in boxes_sent]
    assert not steps[-1].targets


def test_the_script_in_the_docs_tracks_a_target(tmp_path):
    (script,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    port = free_port()
    assert "14550" in script
    script = script.replace("14550", str(port))
    write_clip(tmp_path / "clip.mp4", 150, fps=20)
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", script], stdout=subprocess.PIPE, text=True
    )
    with process, running(tmp_path / "clip.mp4", f"udpout:{HERE}:{port}"):
        lines = [process.stdout.readline() for _ in range(3)]
        process.kill()
    assert lines[0].strip() == "0"  # MAV_RESULT_ACCEPTED
    for line in lines[1:]:
        assert re.fullmatch(r"1 0\.\d+ 0\.\d+ 0\.\d+ 0\.\d+", line.strip())
