"""`ssiam live` ended by a signal, killed or failing: recordings are kept and reported."""

import json
import os
import resource
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from helpers.live_clients import Client, step_until
from helpers.live_server import SECONDS, socket_url
from helpers.synthetic import golden_video
from ssiam.cli import main
from ssiam.video import VideoSink, open_source

EXPORTS = {"cvat.xml", "coco.json", "labelstudio.json", "got10k.zip"}
FILES = {"video.mp4", "results.csv", "results.jsonl", *EXPORTS}
# Runs the command with a failing tracker; argument 1 selects the failure.
RUN_WITH_FAILURE = """
import sys
from helpers import failing_trackers
from ssiam.cli import main, options
failure = {"hang": failing_trackers.Hang(), "leave": failing_trackers.leave}[sys.argv[1]]
options.TrackerOptions.load = lambda self, *_: failing_trackers.failing_tracker(failure)
from ssiam.web import session
session.Session.__init__.__kwdefaults__ = {"stall_seconds": 0.5}
sys.exit(main(sys.argv[2:]))
"""


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "clip.mp4"
    frames, box = golden_video("A")
    with VideoSink(path, 30) as sink:
        for _ in range(20):
            for frame in frames:
                sink.write(frame)
    return path, box


class Live:
    """A running process and the address of its WebSocket."""

    def __init__(self, process):
        self.process, self.first_line = process, process.stdout.readline()
        address = next(word for word in self.first_line.split() if word.startswith("http://"))
        self.url = socket_url(address)

    def end(self, number):
        """Exit code and standard error after a signal."""
        self.process.send_signal(number)
        return self.ended()

    def ended(self):
        _, errors = self.process.communicate(timeout=SECONDS + 10)
        return self.process.returncode, errors


@pytest.fixture
def start(clip):
    """Start the command on the clip with further options."""
    processes = []

    def started(*options, command=("-m", "ssiam"), **kwargs):
        words = [sys.executable, *command, "live", str(clip[0]), "--port", "0", *options]
        process = subprocess.Popen(
            [*words, "--tracker", "kcf"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **kwargs,
        )
        processes.append(process)
        return Live(process)

    yield started
    for process in processes:
        process.kill()
        process.communicate()


def record(client, box, frames=20):
    """Start a recording with a target and wait for some frames; returns its name."""
    client.ask(type="restart")
    client.ask(type="resume")
    assert client.ask(type="add", box=box, name="boat")["type"] == "done"
    name = client.ask(type="record", on=True)["answer"]
    first = step_until(client, lambda step: step["targets"])["number"]
    step_until(client, lambda step: step["number"] > first + frames)
    return name


def check_complete(folder, minimum=1):
    """Check that a recording has all its files and that they can be read; number of frames."""
    assert {path.name for path in folder.iterdir()} >= FILES
    frames = len(list(open_source(str(folder / "video.mp4"))))
    assert frames >= minimum
    assert json.loads((folder / "coco.json").read_text())["categories"][0]["name"] == "boat"
    return frames


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_signal_leaves_complete_recording(clip, start, tmp_path, number):
    live = start("--recordings", str(tmp_path))
    with Client(live) as client:
        name = record(client, clip[1])
        code, errors = live.end(number)
    assert code == (0 if number == signal.SIGINT else 128 + number)
    assert errors == ""
    check_complete(tmp_path / name)


def test_ignored_sighup_stays_ignored(start):
    live = start(preexec_fn=partial(signal.signal, signal.SIGHUP, signal.SIG_IGN))
    live.process.send_signal(signal.SIGHUP)
    with Client(live) as client:
        assert client.ask(type="pause")["type"] == "done"
    assert live.end(signal.SIGTERM)[0] == 128 + signal.SIGTERM


def test_recording_of_a_killed_process_is_listed_and_exported(clip, start, tmp_path):
    live = start("--recordings", str(tmp_path))
    with Client(live) as client:
        name = record(client, clip[1], frames=60)
        assert live.end(signal.SIGKILL)[0] == -signal.SIGKILL
    with next(tmp_path.glob(f"{name}/results*.csv")).open("a") as table:
        table.write("77,2.5")  # an incomplete line
    live = start("--recordings", str(tmp_path))
    with Client(live) as client:
        listed = client.next("recordings")["recordings"]
        assert [each["name"] for each in listed] == [name]
        while listed[0]["open"]:
            listed = client.next("recordings")["recordings"]
    assert set(listed[0]["files"]) == FILES
    assert "was killed" in listed[0]["error"]
    assert listed[0]["frames"] > 10
    check_complete(tmp_path / name, minimum=10)
    live.end(signal.SIGTERM)
    exported = tmp_path / "again.xml"
    video, table = (str(tmp_path / name / file) for file in ("video.mp4", "results.csv"))
    assert main(["export", table, "--to", "cvat", "--video", video, "--out", str(exported)]) == 0


def test_recordings_of_earlier_sessions_are_listed_unchanged(clip, start, tmp_path):
    live = start("--recordings", str(tmp_path))
    with Client(live) as client:
        name = record(client, clip[1])
        assert client.ask(type="record", on=False)["answer"] == name
    live.end(signal.SIGTERM)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / name).iterdir()}
    live = start("--recordings", str(tmp_path))
    with Client(live) as client:
        (listed,) = client.next("recordings")["recordings"]
    assert (listed["open"], listed["error"], set(listed["files"])) == (False, None, FILES)
    live.end(signal.SIGTERM)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / name).iterdir()} == before


def test_recording_in_progress_of_another_process_is_not_touched(clip, start, tmp_path):
    live = start("--recordings", str(tmp_path))
    with Client(live) as client:
        name = record(client, clip[1])
        client.ask(type="pause")  # it does not read while the other one runs
        other = start("--recordings", str(tmp_path))
        with Client(other) as second:
            (listed,) = second.next("recordings")["recordings"]
            second.ask(type="resume")
            step_until(second, lambda step: step["number"] > 10)
        assert listed["open"]
        other.end(signal.SIGTERM)
        assert not EXPORTS & {path.name for path in (tmp_path / name).iterdir()}
        assert client.ask(type="record", on=False)["answer"] == name
    live.end(signal.SIGTERM)
    check_complete(tmp_path / name)


def test_temporary_recordings_of_a_killed_session_are_reported(clip, start, tmp_path):
    environment = {"env": {**os.environ, "TMPDIR": str(tmp_path)}}
    live = start(**environment)
    with Client(live) as client:
        record(client, clip[1])
        running = start(**environment)
        assert running.end(signal.SIGTERM) == (128 + signal.SIGTERM, "")
        live.end(signal.SIGKILL)
    later = start(**environment)
    _, errors = later.end(signal.SIGTERM)
    assert "has recordings of a session that was killed: --recordings" in errors
    (left,) = tmp_path.glob("ssiam-live-*")
    assert str(left) in errors


def limit_file_size(size):
    """Limit the file size of this process, as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def test_full_disk_ends_the_recording_and_notifies_the_page(clip, start, tmp_path):
    live = start("--recordings", str(tmp_path), preexec_fn=partial(limit_file_size, 60_000))
    with Client(live) as client:
        client.ask(type="restart")
        client.ask(type="resume")
        assert client.ask(type="add", box=clip[1], name="boat")["type"] == "done"
        name = client.ask(type="record", on=True)["answer"]
        note = client.next("note")
        assert (note["level"], name in note["message"]) == ("error", True)
        (listed,) = client.next("recordings")["recordings"]
        assert "video" in listed["error"]
        assert not listed["open"]
        assert {"results.csv", "cvat.xml"} <= set(listed["files"])
        step_until(client, lambda step: step["recording"] is None)
        assert client.ask(type="pause")["type"] == "done"
    code, errors = live.end(signal.SIGTERM)
    assert code == 128 + signal.SIGTERM
    assert "Traceback" not in errors
    assert Path(tmp_path / name / "results.csv").stat().st_size > 0


def test_hanging_tracker_does_not_block_exit(clip, start, tmp_path):
    failure = ("-c", RUN_WITH_FAILURE, "hang")
    live = start("--recordings", str(tmp_path), command=failure, env=environment_with_tests())
    with Client(live) as client:
        client.ask(type="restart")
        client.ask(type="resume")
        name = client.ask(type="record", on=True)["answer"]
        client.ask(type="add", box=clip[1], name="boat")
        assert client.next("health")["state"] == "stalled"
        code, errors = live.end(signal.SIGTERM)
    assert code == 128 + signal.SIGTERM
    assert "Tracking has stalled: frame" in errors
    check_complete(tmp_path / name)


def test_crashed_tracking_exits_with_code_3(clip, start, tmp_path):
    failure = ("-c", RUN_WITH_FAILURE, "leave")
    live = start("--recordings", str(tmp_path), command=failure, env=environment_with_tests())
    with Client(live) as client:
        client.ask(type="restart")
        client.ask(type="resume")
        name = client.ask(type="record", on=True)["answer"]
        client.ask(type="add", box=clip[1], name="boat")
        assert client.next("health")["state"] == "failed"
    code, errors = live.ended()
    assert code == 3
    assert "SystemExit: out of the thread" in errors
    check_complete(tmp_path / name)


def environment_with_tests():
    return {**os.environ, "PYTHONPATH": ":".join(sys.path)}
