"""`ssiam live`: starting, tracking, recording and stopping."""

import json
import signal
import socket
import subprocess
import sys
import time

import pytest
from websockets.sync.client import connect

from helpers.live_server import socket_url
from helpers.synthetic import golden_video
from ssiam.cli import main
from ssiam.video import VideoSink, open_source

SECONDS = 30


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "clip.mp4"
    frames, box = golden_video("A")
    with VideoSink(path, 30) as sink:
        for frame in frames:
            sink.write(frame)
    return path, box


@pytest.fixture
def start_live(clip):
    """Start the command on the clip with further options; the process and its first output line."""
    processes = []

    def start(*options):
        command = [sys.executable, "-m", "ssiam", "live", str(clip[0]), "--port", "0"]
        process = subprocess.Popen(
            [*command, "--tracker", "kcf", *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process, process.stdout.readline()

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def find_address(line):
    return next(word for word in line.split() if word.startswith("http://"))


def interrupt(process):
    """Exit code and standard error, after Ctrl-C."""
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=SECONDS)
    return process.returncode, errors


def step_header(message):
    length = int.from_bytes(message[:4], "big")
    return json.loads(message[4 : 4 + length])


def test_live_session(clip, start_live, tmp_path):
    recordings, log = tmp_path / "recordings", tmp_path / "a.rrd"
    process, line = start_live("--recordings", str(recordings), "--rerun", str(log))
    assert line.startswith(f"{clip[0]}: http://127.0.0.1:")
    with connect(socket_url(find_address(line))) as client:

        def ask(**message):
            client.send(json.dumps({"ask": 1, **message}))

        ask(type="restart")
        ask(type="record", on=True)
        ask(type="add", box=clip[1])
        tracked = False
        while not tracked:
            message = client.recv(timeout=SECONDS)
            if isinstance(message, bytes):
                step = step_header(message)
                tracked = bool(step["targets"])
                client.send(json.dumps({"type": "shown", "number": step["number"]}))
    assert interrupt(process) == (0, "")
    (recording,) = recordings.iterdir()
    assert len(list(open_source(recording / "video.mp4"))) >= 1
    assert log.stat().st_size > 1000


def test_a_file_waits_on_its_first_frame(start_live):
    _, line = start_live()
    time.sleep(1)
    with connect(socket_url(find_address(line))) as client:

        def next_step():
            while True:
                message = client.recv(timeout=SECONDS)
                if isinstance(message, bytes):
                    step = step_header(message)
                    client.send(json.dumps({"type": "shown", "number": step["number"]}))
                    return step

        step = next_step()
        assert (step["index"], step["playing"]) == (0, "paused")
        client.send(json.dumps({"type": "resume"}))
        while step["index"] == 0:
            step = next_step()


def test_boxes_and_outputs_of_the_command_line(clip, start_live, tmp_path):
    results = tmp_path / "r.csv"
    box = ",".join(map(str, clip[1]))
    options = ["--box", box, "--box", "9999,9,9,9", "--results", str(results)]
    process, line = start_live(*options, "--pace", "fast")
    assert line.startswith(f"{clip[0]}: http://127.0.0.1:")
    assert process.stderr.readline().startswith("ssiam: --box 9999,9,9,9: ")
    part = tmp_path / "r.part.csv"
    deadline = time.monotonic() + SECONDS
    while part.read_bytes().count(b"\n") < 5:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert interrupt(process) == (0, "")
    assert results.read_text().splitlines()[1].startswith("1,")


@pytest.mark.parametrize("options", [(), ("--token",)])
def test_a_token_is_needed_on_the_loopback(start_live, options):
    process, line = start_live(*options)
    page, _, token = find_address(line).partition("#token=")
    assert len(token) > 20
    with connect(socket_url(find_address(line))) as client:
        assert json.loads(client.recv(timeout=SECONDS))["type"] == "hello"
    for stranger in (page, f"{page}#token=wrong"):
        with pytest.raises(Exception, match="403"):
            connect(socket_url(stranger))
    assert interrupt(process) == (0, "")


def test_no_token(start_live):
    process, line = start_live("--no-token")
    assert find_address(line).endswith("/")
    with connect(socket_url(find_address(line))) as client:
        assert json.loads(client.recv(timeout=SECONDS))["type"] == "hello"
    assert interrupt(process) == (0, "")


def test_no_token_for_other_machines_gives_one_warning(start_live):
    process, line = start_live("--no-token", "--host", "0.0.0.0", "-q")
    with connect(socket_url(find_address(line))) as client:
        assert json.loads(client.recv(timeout=SECONDS))["type"] == "hello"
    code, errors = interrupt(process)
    assert code == 0
    assert errors.startswith(f"ssiam: {find_address(line)} needs no token: ")
    assert errors.count("\n") == 1


def test_port_in_use_gives_one_line_error(clip, capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        arguments = ["live", str(clip[0]), "--tracker", "kcf", "--port", str(port)]
        assert main(arguments) == 2
    error = capsys.readouterr().err
    assert str(port) in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param(["missing.mp4"], "missing.mp4: no such file", id="no file"),
        pytest.param(["CLIP", "--port", "99999"], "99999", id="no port"),
        pytest.param(["CLIP", "--host", "256.1.1.1"], "256.1.1.1", id="no address"),
        pytest.param(["CLIP", "--mavlink", "pigeon:home"], "pigeon:home", id="no link"),
        pytest.param(["CLIP", "--rerun", "/missing/a.rrd"], "/missing/a.rrd", id="no folder"),
        pytest.param(["CLIP", "--pace", "slow"], "slow", id="no pace"),
    ],
)
def test_wrong_arguments_give_one_line_error(clip, capsys, arguments, message):
    given = [str(clip[0]) if word == "CLIP" else word for word in arguments]
    port = [] if "--port" in given else ["--port", "0"]
    assert main(["live", *given, "--tracker", "kcf", *port]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
