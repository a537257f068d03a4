"""`ssiam live` as people start and end it."""

import json
import signal
import socket
import subprocess
import sys

import pytest
from websockets.sync.client import connect

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
def started(clip):
    """Start the command on the clip with more options; the process and the first line it says."""
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


def address_in(line):
    return next(word for word in line.split() if word.startswith("http://"))


def ended(process):
    """Exit code and what was said on stderr, after Ctrl-C."""
    process.send_signal(signal.SIGINT)
    _, complaints = process.communicate(timeout=SECONDS)
    return process.returncode, complaints


def header(message):
    length = int.from_bytes(message[:4], "big")
    return json.loads(message[4 : 4 + length])


def test_it_serves_follows_records_and_ends(clip, started, tmp_path):
    kept, log = tmp_path / "kept", tmp_path / "a.rrd"
    process, line = started("--recordings", str(kept), "--rerun", str(log))
    assert line.startswith(f"{clip[0]}: http://127.0.0.1:")
    with connect(address_in(line).replace("http", "ws") + "session") as client:

        def ask(**message):
            client.send(json.dumps({"ask": 1, **message}))

        ask(type="restart")
        ask(type="record", on=True)
        ask(type="add", box=clip[1])
        followed = False
        while not followed:
            message = client.recv(timeout=SECONDS)
            if isinstance(message, bytes):
                told = header(message)
                followed = bool(told["targets"])
                client.send(json.dumps({"type": "shown", "number": told["number"]}))
    assert ended(process) == (0, "")
    (recording,) = kept.iterdir()
    assert len(list(open_source(recording / "video.mp4"))) >= 1
    assert log.stat().st_size > 1000


def test_a_token_is_printed_where_one_is_asked_for(started):
    process, line = started("--token")
    page, _, token = address_in(line).partition("/#token=")
    assert len(token) > 20
    socket_address = page.replace("http", "ws") + "/session"
    with connect(f"{socket_address}?token={token}") as client:
        assert json.loads(client.recv(timeout=SECONDS))["type"] == "hello"
    with pytest.raises(Exception, match="403"):
        connect(socket_address)
    assert ended(process) == (0, "")


def test_a_port_that_is_taken_is_told_in_one_line(clip, capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        arguments = ["live", str(clip[0]), "--tracker", "kcf", "--port", str(port)]
        assert main(arguments) == 2
    complaint = capsys.readouterr().err
    assert str(port) in complaint
    assert complaint.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        pytest.param(["gone.mp4"], "gone.mp4: no such file", id="no file"),
        pytest.param(["CLIP", "--port", "99999"], "99999", id="no port"),
        pytest.param(["CLIP", "--host", "256.1.1.1"], "256.1.1.1", id="no address"),
        pytest.param(["CLIP", "--mavlink", "pigeon:home"], "pigeon:home", id="no link"),
        pytest.param(["CLIP", "--rerun", "/nowhere/a.rrd"], "/nowhere/a.rrd", id="no folder"),
        pytest.param(["CLIP", "--pace", "slow"], "slow", id="no pace"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(clip, capsys, arguments, says):
    given = [str(clip[0]) if word == "CLIP" else word for word in arguments]
    port = [] if "--port" in given else ["--port", "0"]
    assert main(["live", *given, "--tracker", "kcf", *port]) == 2
    complaint = capsys.readouterr().err
    assert says in complaint
    assert complaint.count("\n") == 1
