"""A thousand hostile commands in all, each followed by a valid one that must be answered."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

import ssiam
from helpers.live_clients import Client, step_until
from helpers.live_server import SECONDS, SIZE, serving, socket_url, until
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.recording import Recordings
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session

COMMANDS = 1000
# The session is tested here, not the server's limits.
UNLIMITED = ServerLimits(
    messages_per_second=1e6,
    burst=10**6,
    bad_messages=10**6,
    frames_per_second=10**6,
    pending_commands=1000,
)
# Codes of the answers: never "failed", which stands for a bug.
CODES = {
    None,
    "bad-message",
    "bad-box",
    "no-such-target",
    "too-many-targets",
    "too-old",
    "not-possible",
}
NUMBERS = (0, 1, 2, -1, 0.5, 3, 4, 59, 118, 119, 160, 161, 1e6, -1e6, 1e5, 2**31, 2**53, 1e308)
TEXTS = (
    "",
    " ",
    "a" * 41,
    "b" * 60_000,
    "\ud800",
    "\0",
    "😀",
    "../../etc/passwd",
    "<script>",
    None,
)


def random_number(r):
    return NUMBERS[r.integers(len(NUMBERS))]


def random_text(r):
    return TEXTS[r.integers(len(TEXTS))]


def random_box(r):
    """Thin, huge, empty, outside of the frame, or not a box."""
    kind = r.integers(6)
    if kind == 0:
        return [random_number(r) for _ in range(r.integers(3, 6))]
    if kind == 1:
        return [*r.uniform(-20, 150, 2), *r.uniform(0, 2, 2)]
    if kind == 2:
        return [*r.uniform(0, 150, 2), float(r.integers(1, 160)), float(r.integers(1, 4))]
    if kind == 3:
        return [*r.uniform(-100, 0, 2), *10 ** r.uniform(0, 6, 2)]
    if kind == 4:
        return [*r.uniform(0, 160, 2), float(r.integers(1, 4)), float(r.integers(1, 120))]
    return (None, "box", {}, [[1, 2], [3, 4]], [True] * 4)[r.integers(5)]


HOSTILE = {
    "add": lambda r: {"box": random_box(r)},
    "add into": lambda r: {"type": "add", "box": random_box(r), "number": random_number(r)},
    "add named": lambda r: {"type": "add", "box": [20, 20, 9, 9], "name": random_text(r)},
    "hold": lambda r: {"number": random_number(r)},
    "remove": lambda r: {"id": random_number(r)},
    "rename": lambda r: {"id": random_number(r), "name": random_text(r)},
    "steady": lambda r: {"method": ("off", "paper", "predict", "literal", "", None)[r.integers(6)]},
    "pause": lambda r: {},
    "resume": lambda r: {},
    "advance": lambda r: {},
    "restart": lambda r: {},
    "record": lambda r: {"on": (True, False, None, 1, "yes")[r.integers(5)]},
    "view": lambda r: {
        "raw": True,
        "steadied": True,
        "width": random_number(r),
        "quality": random_number(r),
    },
    "shown": lambda r: {"number": random_number(r)},
    "nothing": lambda r: {"type": random_text(r)},
}


def hostile_command(r):
    """A random hostile command."""
    kind = list(HOSTILE)[r.integers(len(HOSTILE))]
    fields = HOSTILE[kind](r)
    if isinstance(fields.get("box"), list):
        fields["box"] = [v if isinstance(v, (list, bool)) else float(v) for v in fields["box"]]
    return {"type": kind.split()[0], **fields}


@pytest.mark.parametrize(
    ("tracker", "count"), [("lite", 200), ("csrt", 100), ("mil", 100), ("kcf", COMMANDS - 400)]
)
def test_a_valid_command_is_answered_after_every_hostile_one(tracker, count, tmp_path):
    r = np.random.default_rng(7)
    with (
        serving(tracker=tracker, limits=UNLIMITED, recordings=tmp_path) as live,
        Client(live) as client,
    ):
        until(lambda: live.session.newest is not None)
        codes = set()
        for number in range(count):
            codes.add(client.ask(**hostile_command(r)).get("code"))
            assert client.ask(type="resume")["type"] == "done"
            if number % 20 == 19:
                check_tracking(client)
        assert codes <= CODES
        assert {"bad-box", "no-such-target", "not-possible", None} <= codes
        assert live.session.health.state == "running"


def check_tracking(client):
    """Check that a target can be added and is tracked."""
    client.ask(type="remove")
    client.ask(type="steady", method="predict")
    added = client.ask(type="add", box=[50, 40, 40, 36], name="good")
    assert added["type"] == "done", added
    step = step_until(client, lambda step: [t["name"] for t in step["targets"]] == ["good"])
    later = step_until(client, lambda later: later["number"] > step["number"] + 1)
    assert later.get("error") is None
    assert later["targets"][0].get("error") is None
    assert client.ask(type="remove", id=added["answer"])["type"] == "done"


def jpeg(width, height):
    image = np.random.default_rng(1).integers(0, 255, (height, width, 3), dtype=np.uint8)
    return cv2.imencode(".jpg", cv2.resize(image, (width, height)))[1].tobytes()


@pytest.mark.parametrize("method", ["off", "paper", "predict"])
def test_frames_of_any_size_from_a_browser(method):
    with serving(webcam=True, limits=UNLIMITED) as live, Client(live) as client:
        client.socket.send(jpeg(*SIZE))
        step_until(client, lambda step: step["size"] == list(SIZE))
        assert client.ask(type="steady", method=method)["type"] == "done"
        for size in ((1, 1), (1, 120), (160, 1), (2, 2), (1, 1), (7, 3), (1999, 1), (1, 1999)):
            for _ in range(2):
                client.socket.send(jpeg(*size))
                step = step_until(client, lambda step, size=size: step["size"] == list(size))
                client.ask(type="add", box=[0, 0, *size])
            client.socket.send(jpeg(*SIZE))
            good = step_until(client, lambda step: step["size"] == list(SIZE))
            assert good["number"] > step["number"]
            added = client.ask(type="add", box=[50, 40, 40, 36])
            assert added["type"] == "done"
            client.socket.send(jpeg(*SIZE))
            later = step_until(client, lambda step, good=good: step["index"] > good["index"])
            assert [target["id"] for target in later["targets"]] == [added["answer"]]
            client.ask(type="remove")


def test_after_a_command_that_raises_the_next_one_is_executed():
    with serving(limits=UNLIMITED) as live, Client(live) as client:
        until(lambda: live.session.newest is not None)
        engine = live.session._engine
        original, engine._record = engine._record, lambda on: 1 / 0
        answer = client.ask(type="record", on=True)
        assert (answer["code"], "ZeroDivisionError" in answer["message"]) == ("failed", True)
        engine._record = original
        assert client.ask(type="record", on=True)["type"] == "done"
        assert client.ask(type="record", on=False)["type"] == "done"


def test_damaged_frames_from_a_browser_do_not_end_the_session():
    feed = PushedFeed()
    tracker = ssiam.load_tracker("kcf", stabilize="paper")
    with (
        Session(feed, tracker, "kcf", Recordings()) as session,
        LiveServer(session, port=0, limits=UNLIMITED) as server,
    ):
        r = np.random.default_rng(3)
        address = socket_url(server.address)
        from websockets.sync.client import connect

        with connect(address, max_size=None) as socket:
            good = jpeg(*SIZE)
            for _ in range(100):
                bad = bytearray(good)
                for offset in r.integers(2, len(bad) - 2, 20):
                    bad[offset] = r.integers(256)
                socket.send(bytes(bad))
                socket.send(good)
                socket.send(json.dumps({"type": "pause", "ask": 1}))
                socket.send(json.dumps({"type": "resume", "ask": 2}))
                answered = 0
                while answered < 2:
                    message = socket.recv(timeout=SECONDS)
                    if isinstance(message, str):
                        answered += json.loads(message)["type"] == "done"
                    else:
                        number = session.newest.number
                        socket.send(json.dumps({"type": "shown", "number": number}))
        assert session.health.state == "running"
