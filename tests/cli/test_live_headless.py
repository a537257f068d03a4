"""`ssiam live --headless`: without a person, from a source that may come later, to whole files."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time

import pytest

from helpers.synthetic import golden_video
from helpers.tracked_clip import box_of, rows_of
from ssiam.cli import main
from ssiam.video import VideoSink, open_source

SECONDS = 60
REPEATS = 6


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("headless") / "clip.mp4"
    frames, box = golden_video("A")
    with VideoSink(path, 30) as sink:
        for _ in range(REPEATS):
            for frame in frames:
                sink.write(frame)
    os.utime(path, (0, 0))  # written long ago
    return path, box, REPEATS * len(frames)


@pytest.fixture
def start(tmp_path):
    processes = []

    def started(source, box, *options, **kwargs):
        words = [sys.executable, "-m", "ssiam", "live", str(source), "--headless"]
        words += ["--box", box_of(box), "--tracker", "kcf", *options]
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **kwargs}
        process = subprocess.Popen(words, text=True, cwd=tmp_path, **streams)
        processes.append(process)
        return process

    yield started
    for process in processes:
        process.kill()
        process.communicate()


def test_a_file_is_tracked_to_its_end(clip, start, tmp_path):
    path, box, count = clip
    process = start(path, box, "--pace", "fast", "--out", "o.mp4", "--results", "r.csv")
    assert process.communicate(timeout=SECONDS) == ("", "")
    assert process.returncode == 0
    assert len(list(open_source(tmp_path / "o.mp4"))) == count
    rows = rows_of(tmp_path / "r.csv")
    assert [int(row["frame"]) for row in rows] == list(range(1, count))
    assert sorted(each.name for each in tmp_path.iterdir()) == ["o.mp4", "r.csv"]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 0)])
def test_a_signal_finishes_the_outputs(clip, start, tmp_path, number, code):
    process = start(clip[0], clip[1], "--out", "o.mp4", "--results", "r.jsonl")
    part = tmp_path / "r.part.jsonl"
    wait_for(lambda: part.exists() and part.read_bytes().count(b"\n") > 5)
    process.send_signal(number)
    assert process.communicate(timeout=SECONDS) == ("", "")
    assert process.returncode == code
    rows = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    assert len(list(open_source(tmp_path / "o.mp4"))) >= len(rows) > 5
    assert sorted(each.name for each in tmp_path.iterdir()) == ["o.mp4", "r.jsonl"]


def wait_for(condition):
    deadline = time.monotonic() + SECONDS
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_rows_arrive_on_standard_output(clip, start):
    process = start(clip[0], clip[1], "--results", "-")
    assert json.loads(process.stdout.readline())["target"] == 1
    process.stdout.close()  # the reader leaves, which ends the run
    assert process.wait(timeout=SECONDS) == 0
    assert process.stderr.read() == ""


def test_a_file_that_is_written_later_is_waited_for(clip, start, tmp_path):
    process = start("later.mp4", clip[1], "--pace", "fast", "--results", "r.csv")
    line = process.stderr.readline()
    assert (
        line == "ssiam: waiting for the source: later.mp4: no such file or folder; check the path\n"
    )
    content = clip[0].read_bytes()
    with (tmp_path / "later.mp4").open("wb") as file:
        for start_byte in range(0, len(content), len(content) // 5):
            file.write(content[start_byte : start_byte + len(content) // 5])
            file.flush()
            time.sleep(0.2)
    assert process.communicate(timeout=SECONDS) == ("", "")  # one line, however long it takes
    assert process.returncode == 0
    assert len(rows_of(tmp_path / "r.csv")) == clip[2] - 1


@pytest.mark.parametrize("source", ["98", "rtsp://127.0.0.1:1/cam", "missing.mkv"])
def test_waiting_ends_with_a_signal_and_leaves_nothing(clip, start, tmp_path, source):
    process = start(source, clip[1], "--out", "o.mp4")
    assert process.stderr.readline().startswith("ssiam: waiting for the source: ")
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=SECONDS) == ("", "")
    assert process.returncode == 143
    assert list(tmp_path.iterdir()) == []


def test_quiet_waits_in_silence(clip, start, tmp_path):
    process = start("later.mp4", clip[1], "-q", "--pace", "fast", "--results", "r.csv")
    time.sleep(1)
    shutil.copy2(clip[0], tmp_path / "later.mp4")  # as old as the clip
    assert process.communicate(timeout=SECONDS) == ("", "")
    assert process.returncode == 0


def test_a_pipe_as_the_output(clip, start, tmp_path):
    os.mkfifo(tmp_path / "rows.jsonl")
    found = []

    def read():
        with (tmp_path / "rows.jsonl").open() as file:
            found.extend(json.loads(line)["frame"] for line in file)

    reader = threading.Thread(target=read)
    reader.start()
    process = start(clip[0], clip[1], "--pace", "fast", "--results", "rows.jsonl")
    assert process.communicate(timeout=SECONDS) == ("", "")
    reader.join()
    assert found == list(range(1, clip[2]))


def test_a_full_disk_ends_the_run_with_an_error(clip, start):
    with open("/dev/full", "w") as full:
        process = start(clip[0], clip[1], "--results", "-", stdout=full)
        _, errors = process.communicate(timeout=SECONDS)
    assert process.returncode == 2
    assert "cannot be written (No space left on device)" in errors.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("--out", "o.mp4"), "--box x,y,width,height", id="no box"),
        pytest.param(("--out", "o.mp4"), "--pick", id="no box, names pick"),
        pytest.param(("--box", "9,9,9,9"), "give --out", id="no output"),
        pytest.param(("--box", "9:9,9,9,9", "--out", "o.mp4"), "no timeline", id="later box"),
        pytest.param(("--box", "9,9,9", "--out", "o.mp4"), "'9,9,9'", id="three numbers"),
        pytest.param(("--box", "9999,9,9,9", "--out", "o.mp4"), "outside", id="outside"),
        pytest.param(("--box", "9,9,9,9", "--out", "o.xyz"), "o.xyz", id="kind of video"),
        pytest.param(("--box", "9,9,9,9", "--results", "o.txt"), "o.txt", id="kind of results"),
        pytest.param(("--box", "9,9,9,9", "--out", "no/o.mp4"), "no folder", id="no folder"),
        pytest.param(
            ("--box", "9,9,9,9", "--out", "clip.mp4", "--overwrite"), "clip.mp4", id="the source"
        ),
        pytest.param(
            ("--box", "9,9,9,9", "--recordings", "r", "--out", "o.mp4"), "--recordings", id="page"
        ),
    ],
)
def test_refusals_are_one_line(clip, tmp_path, monkeypatch, capsys, arguments, named):
    monkeypatch.chdir(tmp_path)
    shutil.copy2(clip[0], "clip.mp4")
    assert main(["live", "clip.mp4", "--headless", "--tracker", "kcf", *arguments]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert named in error
    assert not list(tmp_path.glob("*.csv"))


def test_the_browser_as_the_source_needs_the_page(capsys):
    words = ["live", "browser", "--headless", "--box", "9,9,9,9", "--out", "o.mp4"]
    assert main(words) == 2
    assert "omit --headless" in capsys.readouterr().err


def test_headless_needs_no_package_of_the_page(clip, tmp_path):
    code = (
        "import sys; from ssiam.cli import main;"
        f"main(['live', {str(clip[0])!r}, '--headless', '--box', {box_of(clip[1])!r}, '--tracker',"
        f" 'kcf', '--pace', 'fast', '--results', {str(tmp_path / 'r.csv')!r}]);"
        "print(sorted({'uvicorn', 'starlette', 'websockets'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr
