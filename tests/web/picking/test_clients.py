"""The picking page's protocol over real sockets: messages, hostile clients, files."""

from __future__ import annotations

import threading
import time
from contextlib import closing
from urllib.parse import quote

import numpy as np
import pytest

from helpers.live_clients import Client, step_until
from helpers.live_server import SECONDS, until
from helpers.picking import FRAMES, SIZE, as_live, picking
from helpers.raw_sockets import frame, handshake, raw_socket, send_until_closed, status_of
from ssiam.web.server.limits import ServerLimits

BOX = [20, 30, 40, 36]
# The session is tested here, not the server's limits.
UNLIMITED = ServerLimits(messages_per_second=1e6, burst=10**6, bad_messages=10**6)


@pytest.fixture
def live():
    with picking(limits=UNLIMITED, grace=(60, 60)) as page:
        live = as_live(page)
        live.page = page
        yield live


@pytest.fixture
def client(live):
    with Client(live) as client:
        yield client


def next_state(client, condition):
    while True:
        state = client.next("picking")
        if condition(state):
            return state


def test_the_first_messages(client):
    hello = client.next("hello")
    assert (hello["source"], hello["size"], hello["length"]) == ("clip", list(SIZE), FRAMES)
    state = client.next("picking")
    assert (state["phase"], state["targets"], state["undo"]) == ("picking", [], False)
    header, images = client.next("step")
    assert (header["index"], header["playing"]) == (0, "paused")
    assert images["raw"].shape == (SIZE[1], SIZE[0], 3)


def test_all_clients_see_the_same(live, client):
    with Client(live) as other:
        assert client.ask(type="add", frame=0, box=BOX)["answer"] == 1
        state = next_state(other, lambda state: state["targets"])
        assert state["targets"] == [
            {"id": 1, "name": "target 1", "colour": "#5ae63c", "frame": 0, "box": BOX}
        ]
        assert client.ask(type="seek", index=7)["answer"] == 7
        step_until(other, lambda header: header["index"] == 7)


def test_progress_and_files_reach_clients_that_come_later(live, client, tmp_path):
    client.ask(type="add", frame=0, box=BOX)
    client.ask(type="track")
    live.page.report(7, FRAMES, 12.5)
    with Client(live) as late:
        state = late.next("picking")
        assert state["phase"] == "tracking"
        assert state["progress"] == {"done": 7, "total": FRAMES, "fps": 12.5}
    written = tmp_path / "a b#1.csv"
    written.write_text("frame\n")
    (tmp_path / "secret.csv").write_text("no")
    live.page.finish([("results", written), ("video", tmp_path / "missing.mp4")], ["in a folder"])
    state = next_state(client, lambda state: state["phase"] == "written")
    assert state["files"] == [{"kind": "results", "name": "a b#1.csv", "bytes": 6}]
    assert state["notes"] == ["in a folder"]
    query = live.url.partition("?")[2]
    assert live.get(f"/written/a%20b%231.csv?{query}")[::2] == (200, b"frame\n")
    for path in (
        "secret.csv",
        "../secret.csv",
        "%2e%2e/secret.csv",
        quote(f"/{written}"),
        "",
        "missing.mp4",
    ):
        assert live.get(f"/written/{path}?{query}")[0] == 404, path
    assert live.get("/written/a%20b%231.csv")[0] == 403, "a file without the token"


def test_strangers_are_refused(live):
    for target, headers in [
        ("/session", ()),
        ("/session?token=wrong", ()),
        (None, ("Origin: http://evil.example",)),
    ]:
        with closing(raw_socket(live)) as raw:
            raw.sendall(handshake(live, *headers, target=target))
            assert status_of(raw.recv(64)) == 403
    assert live.get("/", host="evil.example")[0] == 403
    assert live.get("/", method="POST")[0] == 405
    assert live.get("/")[0] == 200


NUMBERS = (
    0,
    1,
    2,
    -1,
    0.5,
    3,
    FRAMES - 1,
    FRAMES,
    1e6,
    -1e6,
    2**31,
    2**53,
    1e308,
    None,
    "1",
    [1],
    True,
)


def hostile_command(r):
    def number():
        return NUMBERS[r.integers(len(NUMBERS))]

    fields = {
        "seek": {"index": number()},
        "add": {"frame": number(), "box": [number() for _ in range(r.integers(3, 6))]},
        "click": {"frame": number(), "point": [number() for _ in range(r.integers(1, 4))]},
        "adjust": {"id": number(), "box": [number() for _ in range(4)]},
        "remove": {"id": number()},
        "undo": {},
        "preview": {"id": number()},
        "finish": {},
        "pause": {},
        "rename": {"id": 1, "name": "x"},
        "restart": {},
    }
    kind = list(fields)[r.integers(len(fields))]
    return {"type": kind, **fields[kind]}


def test_a_valid_command_is_answered_after_every_hostile_one(live, client):
    r = np.random.default_rng(5)
    codes = set()
    for _ in range(400):
        codes.add(client.ask(**hostile_command(r)).get("code"))
        # Previews and far frames are cut short by this.
        assert client.ask(type="seek", index=3) == {"type": "done", "ask": 7, "answer": 3}
    assert {"bad-message", "bad-box", "too-old", "no-such-target", "not-possible"} <= codes
    assert "failed" not in codes
    added = client.ask(type="add", frame=3, box=BOX)
    assert added["type"] == "done"


@pytest.mark.parametrize("text", ["{", "[" * 60_000, '{"type":"add","frame":0,"box":[NaN,1,2,3]}'])
def test_nonsense_is_answered(client, text):
    client.socket.send(text)
    assert client.next("error")["code"] == "bad-message"


def test_a_client_that_floods_does_not_disturb_a_person():
    options = {"grace": (60, 60), "limits": ServerLimits(handshake_seconds=1)}
    with picking(**options) as page, Client(as_live(page)) as person:
        nonsense = frame(1, b'{"type":"un"}')
        flood = raw_socket(as_live(page))
        flood.sendall(handshake(as_live(page)))
        attack = threading.Thread(target=send_until_closed, args=(flood, nonsense))
        attack.start()
        while attack.is_alive():
            assert person.ask(type="seek", index=1)["answer"] == 1
            time.sleep(0.05)
        flood.close()
        assert person.ask(type="add", frame=1, box=BOX)["answer"] == 1
        until(lambda: page._clients == 1)


def test_the_run_is_not_ended_by_a_client_that_vanishes(live, client):
    client.ask(type="add", frame=0, box=BOX)
    client.ask(type="track")
    client.vanish()
    until(lambda: live.page._clients == 0)
    live.page.report(1, FRAMES, None)
    assert live.page.wait_for_targets()[0].xywh == tuple(map(float, BOX))
    with Client(live) as other:
        assert other.next("picking", SECONDS)["phase"] == "tracking"
