"""A client of a real session, over a real socket."""

import asyncio
import json
import logging
import subprocess
import sys
import time

import pytest
from live_server import SECONDS, SIZE, Client, Watcher, serving, until

from ssiam.web.errors import Note
from ssiam.web.server.encoding import encode_jpeg
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.outbox import Outbox
from synthetic import world


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    with serving(recordings=tmp_path_factory.mktemp("recordings")) as live:
        yield live


@pytest.fixture
def client(live):
    with Client(live) as client:
        yield client


def test_hello_comes_first_then_the_recordings_then_steps(client):
    hello, listed, step = (client.socket.recv(timeout=SECONDS) for _ in range(3))
    assert json.loads(hello)["type"] == "hello"
    assert json.loads(hello)["size"] == list(SIZE)
    assert json.loads(listed)["type"] == "recordings"
    assert isinstance(step, bytes)


def test_steps_come_with_their_pictures(client):
    first, pictures = client.next("step")
    assert list(pictures) == ["raw", "steadied"]
    assert all(picture.shape == (120, 160, 3) for picture in pictures.values())
    second, _ = client.next("step")
    assert second["number"] > first["number"]
    assert second["motion"] is not None
    assert second["playing"] == "playing"


VIEWS = [
    (True, True, 64, ["raw", "steadied"]),
    (False, True, 160, ["steadied"]),
    (True, False, 4096, ["raw"]),
    (False, False, 64, []),
]


@pytest.mark.parametrize(("raw", "steadied", "width", "names"), VIEWS)
def test_a_client_gets_what_it_wants_to_see(client, raw, steadied, width, names):
    view = {"type": "view", "raw": raw, "steadied": steadied, "width": width, "quality": 60}
    assert client.ask(**view) == {"type": "done", "ask": 7, "answer": None}
    client.next("step")  # may have been under way
    client.next("step")
    _, pictures = client.next("step")
    assert list(pictures) == names
    assert all(picture.shape[1] == min(width, 160) for picture in pictures.values())


def test_another_view_is_seen_while_all_stands_still(live, client):
    client.ask(type="pause")
    try:
        still = step_until(client, lambda header: header["playing"] == "paused")
        client.send(type="view", raw=True, steadied=False, width=64, quality=60)
        header, pictures = client.next("step")
        assert header["index"] == still["index"]
        assert pictures["raw"].shape[1] == 64
    finally:
        client.ask(type="resume")


def step_until(client, wanted):
    """The header of the first step that is as wanted."""
    while True:
        header, _ = client.next("step")
        if wanted(header):
            return header


def test_two_steps_are_under_way_and_the_newest_comes_next(live):
    with Client(live, acknowledge=False) as client:
        first, second = client.next("step")[0], client.next("step")[0]
        with pytest.raises(TimeoutError):
            client.next("step", seconds=0.5)
        newest = live.session.newest.number
        client.send(type="shown", number=first["number"])
        third = client.next("step")[0]
        assert third["number"] >= newest
        between = third["number"] - second["number"] - 1
        assert between > 3
        assert third["skipped"] == second["skipped"] + between
        client.send(type="shown", number=third["number"])  # and those before
        client.next("step")
        client.next("step")


def test_commands_are_answered(client):
    added = client.ask(type="add", box=[40, 30, 40, 30], name="boat")
    assert added["type"] == "done"
    number = added["answer"]
    header = step_until(client, lambda header: header["targets"])
    assert [(t["id"], t["name"]) for t in header["targets"]] == [(number, "boat")]
    assert client.ask(type="rename", id=number, name="ship")["type"] == "done"
    assert client.ask(type="remove")["type"] == "done"
    step_until(client, lambda header: not header["targets"])


REFUSED = [
    ({"type": "remove", "id": 999}, "no-such-target"),
    ({"type": "add", "box": [1000, 1000, 5, 5]}, "bad-box"),
    ({"type": "add", "box": [0, 0, 0, 5]}, "bad-box"),
    ({"type": "add", "box": [9, 9, 30, 30], "number": 10**9}, "too-old"),
    ({"type": "restart"}, "not-possible"),
    ({"type": "fly"}, "bad-message"),
    ({"type": "remove", "id": "1"}, "bad-message"),
]


@pytest.mark.parametrize(("command", "code"), REFUSED)
def test_a_command_that_fails_says_why(client, command, code):
    error = client.ask(**command)
    assert (error["type"], error["code"]) == ("error", code)
    assert error["message"]


def test_without_ask_only_errors_are_answered(client):
    client.send(type="resume")
    client.socket.send("what?")
    message = client.next("error")
    assert (message["ask"], message["code"]) == (None, "bad-message")


def test_a_recording_is_announced_and_fetched(live, client):
    name = client.ask(type="record", on=True)["answer"]
    step_until(client, lambda header: header["recording"] == name)
    client.next("step")
    assert live.get(f"/recordings/{name}/video.mp4")[0] == 404
    assert client.ask(type="record", on=False)["answer"] == name
    listed = client.next("recordings")["recordings"]
    while listed[-1]["open"] or not listed[-1]["files"]:
        listed = client.next("recordings")["recordings"]
    file = listed[-1]["files"][0]
    status, headers, body = live.get(f"/recordings/{name}/{file}")
    assert status == 200
    assert headers["content-disposition"] == f'attachment; filename="{name}-{file}"'
    assert body == live.session.recordings.path(name, file).read_bytes()
    assert live.get(f"/recordings/{name}/{file}", "Range: bytes=0-9")[2] == body[:10]


def test_notes_reach_everybody(live, client):
    with Client(live) as other:
        for each in (client, other):
            each.next("step")
        live.news.tell(Note("warning", "the camera is gone"))
        told = {"type": "note", "level": "warning", "message": "the camera is gone"}
        assert client.next("note") == other.next("note") == told


def test_clients_are_counted(live, client):
    with Client(live):
        step_until(client, lambda header: header["clients"] == 2)
    step_until(client, lambda header: header["clients"] == 1)


FILES = [("/", "text/html"), ("/page/index.html", "text/html"), ("/page/main.js", "javascript")]


@pytest.mark.parametrize(("path", "kind"), [*FILES, ("/health", "application/json")])
def test_page_is_served(live, path, kind):
    status, headers, body = live.get(path)
    assert status == 200
    assert kind in headers["content-type"]
    assert len(body) == int(headers["content-length"]) > 0
    assert "server" not in headers
    status, head, body = live.get(path, method="HEAD")
    assert (status, body, head["content-length"]) == (200, b"", headers["content-length"])


def test_no_more_clients_than_can_be_served():
    with serving(limits=ServerLimits(clients=2)) as live, Client(live), Client(live) as second:
        with pytest.raises(Exception, match="403"):
            Client(live)
        second.close()
        until(lambda: live.clients == 1)
        Client(live).close()


def test_all_are_told_when_the_server_ends():
    with serving() as live:
        clients = [Client(live) for _ in range(3)]
        clients[0].next("step")
        live.server.close()
        live.server.close()
        assert [client.close_code() for client in clients] == [1001] * 3
        before = live.session.newest.number
        until(lambda: live.session.newest.number >= before + 3)  # the session goes on


def test_the_port_is_free_again():
    with serving() as live:
        port = live.port
    with serving(port=port) as live:
        assert live.get("/health")[0] == 200


def test_a_client_that_leaves_is_forgotten_whatever_it_asked():
    with serving() as live:
        watcher = Watcher(live)
        with watcher.undisturbed():
            for _ in range(20):
                client = Client(live)
                client.send(type="remove", id=999, ask=1)
                client.send(type="view", ask=2)
                client.vanish()
        watcher.close()


@pytest.mark.parametrize("ticks", range(5))
def test_sending_ends_whatever_comes_at_the_same_moment(ticks):
    class Deaf:
        async def send(self, event):
            pass

    async def scenario():
        outbox = Outbox(Deaf(), ServerLimits(), lambda: 1)
        outbox._under_way.append((1, time.monotonic()))
        task = asyncio.ensure_future(outbox.run())
        await asyncio.sleep(0.01)
        outbox.say("news")
        for _ in range(ticks):
            await asyncio.sleep(0)
        outbox.stop()
        task.cancel()
        return await asyncio.wait([task], timeout=3)

    _, pending = asyncio.run(scenario())
    assert not pending


def test_a_browsers_camera_is_the_source():
    with serving(webcam=True) as live, Client(live) as client, Client(live) as other:
        assert client.next("hello")["size"] is None
        client.socket.send(encode_jpeg(world(3, (200, 100)), 200, 90))
        _, pictures = client.next("step")
        assert pictures["raw"].shape == (100, 200, 3)
        other.socket.send(encode_jpeg(world(3, (200, 100)), 200, 90))
        assert other.next("error")["code"] == "not-possible"
        client.socket.send(b"\xff\xd8 no picture")
        assert client.next("error")["code"] == "bad-message"
        client.close()
        until(lambda: live.clients == 1)
        other.socket.send(encode_jpeg(world(3, (300, 100)), 300, 90))
        while other.next("step")[1]["raw"].shape != (100, 300, 3):
            pass


TOO_LARGE = [("picture", b"\xff\xd8" + bytes(90_000)), ("text", "x" * 70_000)]


@pytest.mark.parametrize("message", [t[1] for t in TOO_LARGE], ids=[t[0] for t in TOO_LARGE])
def test_a_browsers_camera_has_limits_too(message):
    limits = ServerLimits(picture_bytes=80_000)
    with serving(webcam=True, limits=limits) as live, Client(live) as client:
        client.socket.send(message)
        assert client.close_code() == 1009


def test_the_token_opens_the_door_and_is_never_logged(caplog):
    caplog.set_level(logging.DEBUG)
    with serving(needs_token=True) as live:
        token = live.server.access.token
        assert live.server.address == f"http://127.0.0.1:{live.port}/#token={token}"
        with Client(live) as client:
            client.next("step")
        assert live.get("/")[0] == 200
        assert live.get("/health")[0] == 403
        assert live.get(f"/health?token={token}")[0] == 200
        assert live.get("/health", f"Authorization: Bearer {token}")[0] == 200
    ours = [record for record in caplog.records if record.name != "websockets.client"]
    assert ours
    assert all(token not in record.getMessage() for record in ours)


def test_run_serves_until_it_is_interrupted(tmp_path):
    code = """
import sys, signal, threading, urllib.request
sys.path[:0] = sys.argv[1:3]
from live_server import serving
with serving() as live:
    live.server.close()
from ssiam.web.server.serving import LiveServer
server = LiveServer(live.session, port=0)
def look():
    print(urllib.request.urlopen(f"http://127.0.0.1:{server.access.port}/health").status)
    signal.raise_signal(signal.SIGINT)
threading.Timer(0.3, look).start()
server.run()
print("ended")
"""
    folders = [entry for entry in sys.path if entry.rstrip("/").endswith(("tests", "tests/web"))]
    done = subprocess.run(
        [sys.executable, "-c", code, *folders[:2]], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["200", "ended"], done.stderr


def test_without_the_extra_one_line_says_what_to_install():
    code = """
import sys
for package in ("starlette", "uvicorn", "websockets"):
    sys.modules[package] = None
    try:
        import ssiam.web.server.serving
    except Exception as error:
        print(type(error).__name__, error)
    del sys.modules[package]
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    lines = done.stdout.splitlines()
    for package, line in zip(("starlette", "uvicorn", "websockets"), lines, strict=True):
        assert line.startswith(f"MissingExtraError the package {package} is not installed")
        assert line.endswith("pip install 'ssiam[web]'")
