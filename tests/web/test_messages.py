"""Messages of docs/live-protocol.md: what is read of them, and what is refused."""

import json
import math
import struct

import numpy as np
import pytest
from message_fuzz import GOOD, fuzzed

from ssiam.errors import ArgumentError
from ssiam.geometry import IDENTITY, frame_centre, rigid
from ssiam.motion import Motion
from ssiam.trackers import Track
from ssiam.video import Frame
from ssiam.web import commands
from ssiam.web.errors import CommandError
from ssiam.web.info import SessionInfo, SessionLimits
from ssiam.web.server import announcements
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.messages import BadMessage, Message, View, parse_message
from ssiam.web.step import Step, Target

BOX = [1.5, 2, 30, 40]
VIEW = {"type": "view", "raw": True, "steadied": True, "width": 960, "quality": 80}
BAD = [
    # name, message as an object or as text
    ("nothing", ""),
    ("no JSON", "{"),
    ("a list", "[]"),
    ("a number", "7"),
    ("null", "null"),
    ("no type", "{}"),
    ("type is a list", {"type": ["pause"]}),
    ("type is an object", {"type": {}}),
    ("unknown type", {"type": "shutdown"}),
    ("type of the server", {"type": "hello"}),
    ("deep list", "[" * 60_000),
    ("deep object", '{"a":' * 10_000),
    ("deep field", '{"type":"pause","a":' + "[" * 30_000),
    ("NaN", '{"type":"add","box":[NaN,1,2,3]}'),
    ("Infinity", '{"type":"add","box":[1,1,Infinity,3]}'),
    ("-Infinity where nobody looks", '{"type":"pause","a":-Infinity}'),
    ("infinite", '{"type":"add","box":[1,1,1e999,3]}'),
    ("thousands of digits", '{"type":"add","box":[1,1,' + "9" * 4000 + ",3]}"),
    ("too many digits", '{"type":"add","box":[1,1,' + "9" * 60_000 + ",3]}"),
    ("box of three", {"type": "add", "box": [1, 2, 3]}),
    ("box of words", {"type": "add", "box": ["1", 2, 3, 4]}),
    ("box of booleans", {"type": "add", "box": [True, 2, 3, 4]}),
    ("box of lists", {"type": "add", "box": [[1], 2, 3, 4]}),
    ("no box", {"type": "add"}),
    ("number is a float", {"type": "add", "box": BOX, "number": 8.0}),
    ("number is true", {"type": "shown", "number": True}),
    ("number is 0", {"type": "shown", "number": 0}),
    ("number is huge", {"type": "hold", "number": 2**53 + 1}),
    ("id is null", {"type": "remove", "id": None}),
    ("id is a word", {"type": "remove", "id": "1"}),
    ("id below 1", {"type": "rename", "id": -1, "name": "boat"}),
    ("no name", {"type": "rename", "id": 1}),
    ("empty name", {"type": "rename", "id": 1, "name": " \n"}),
    ("long name", {"type": "rename", "id": 1, "name": "x" * 41}),
    ("half a surrogate pair", '{"type":"rename","id":1,"name":"\\ud800"}'),
    ("control character", {"type": "rename", "id": 1, "name": "a\x00b"}),
    ("writing turned around", {"type": "rename", "id": 1, "name": "a\u202eb"}),
    ("unknown method", {"type": "steady", "method": "literal"}),
    ("method is a list", {"type": "steady", "method": ["off"]}),
    ("on is a number", {"type": "record", "on": 1}),
    ("width too small", VIEW | {"width": 63}),
    ("width too large", VIEW | {"width": 4097}),
    ("width is a float", VIEW | {"width": 960.5}),
    ("quality too high", VIEW | {"quality": 96}),
    ("raw is a word", VIEW | {"raw": "yes"}),
    ("half a view", {"type": "view", "raw": True}),
    ("ask below 0", {"type": "pause", "ask": -1}),
    ("ask too large", {"type": "pause", "ask": 2**31 + 1}),
    ("ask is a float", {"type": "pause", "ask": 1.0}),
    ("ask is true", {"type": "pause", "ask": True}),
    ("ask is null", {"type": "pause", "ask": None}),
]


def as_text(message):
    return message if isinstance(message, str) else json.dumps(message)


@pytest.mark.parametrize(("message", "content"), [g[1:] for g in GOOD], ids=[g[0] for g in GOOD])
def test_a_message_is_what_the_protocol_says(message, content):
    assert parse_message(json.dumps(message)) == Message(content)
    for ask in (0, 2**31):
        assert parse_message(json.dumps(message | {"ask": ask})) == Message(content, ask)


@pytest.mark.parametrize("message", [b[1] for b in BAD], ids=[b[0] for b in BAD])
def test_what_cannot_be_used_is_refused_in_one_short_line(message):
    with pytest.raises(BadMessage) as caught:
        parse_message(as_text(message))
    assert caught.value.code == "bad-message"
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("box", [[1, 2, 0, 4], [1, 2, 3, -4], [1e7, 2, 3, 4], [1, 2, 3, 1e9]])
def test_a_box_that_is_none_has_a_code_of_its_own(box):
    with pytest.raises(BadMessage) as caught:
        parse_message(json.dumps({"type": "add", "box": box, "ask": 5}))
    assert (caught.value.code, caught.value.ask) == ("bad-box", 5)


def test_the_answer_to_a_bad_message_repeats_its_ask():
    with pytest.raises(BadMessage) as caught:
        parse_message('{"type": "remove", "id": "x", "ask": 12}')
    assert caught.value.ask == 12


def test_whatever_comes_is_read_or_refused():
    outcomes = {"read": 0, "bad-message": 0, "bad-box": 0}
    for text in fuzzed(seed=20, count=12_000):
        try:
            message = parse_message(text)
        except BadMessage as error:
            outcomes[error.code] += 1
            announcements.refusal(error.ask, error).encode()
            continue
        outcomes["read"] += 1
        check(message)
    assert min(outcomes.values()) > 3, outcomes


def check(message):
    """Nothing that comes through is out of its range."""
    content = message.content
    assert message.ask is None or (type(message.ask) is int and 0 <= message.ask <= 2**31)
    for name in ("number", "id"):
        value = getattr(content, name, None)
        assert value is None or (type(value) is int and 1 <= value <= 2**53)
    if isinstance(content, commands.Add):
        assert all(type(v) is float and math.isfinite(v) for v in content.xywh)
        assert min(content.xywh[2:]) > 0
    if isinstance(content, View):
        assert type(content.raw) is type(content.steadied) is bool
        assert 64 <= content.width <= 4096
        assert 30 <= content.quality <= 95
    if isinstance(content, (commands.Add, commands.Rename)) and content.name is not None:
        assert content.name.encode()
        assert len(content.name) <= 40


def step(**options):
    frame = Frame(811, 27.03, np.zeros((36, 64, 3), np.uint8))
    turn = rigid(3, -2, 0.01, frame_centre((64, 36)))
    values = {
        "number": 812,
        "frame": frame,
        "targets": (
            Target(1, "boat", "#5ae63c", Track((1, 2, 3, np.float32(4.123456)), 0.93)),
            Target(4, "half", "#ff0000", Track((1, 2, 3, 4), 0.1, True, np.ones((4, 2))), True),
        ),
        "motion": Motion(turn, 0.8, True, (64, 36)),
        "stab_from_raw": turn,
        "stabilize": "predict",
        "arrived": 5.0,
        "done": 5.0125,
        "fps": 29.97,
        "dropped": 3,
        "playing": "playing",
    }
    return Step(**(values | options))


def header_of(message):
    (length,) = struct.unpack_from(">I", message)
    return json.loads(message[4 : 4 + length]), message[4 + length :]


def test_a_step_is_header_and_pictures():
    pictures = [("raw", b"abc"), ("steadied", b"defgh")]
    message = announcements.step_message(step(), pictures, skipped=2, clients=1)
    header, rest = header_of(message)
    assert rest == b"abcdefgh"
    assert header.pop("motion") == pytest.approx(
        {"dx": 3, "dy": -2, "angle": 0.01, "inliers": 0.8, "reliable": True}
    )
    turn = rigid(3, -2, 0.01, frame_centre((64, 36)))
    assert np.allclose(header.pop("stab_from_raw"), turn[:2], atol=1e-7)
    boat, half = header.pop("targets")
    assert boat == {
        **{"id": 1, "name": "boat", "colour": "#5ae63c", "box": [1, 2, 3, 4.1235]},
        **{"corners": None, "score": 0.93, "lost": False, "found": False},
    }
    assert (half["corners"], half["lost"], half["found"]) == ([[1, 1]] * 4, True, True)
    assert header == {
        **{
            "type": "step",
            "number": 812,
            "index": 811,
            "size": [64, 36],
            "time": 27.03,
            "stabilize": "predict",
        },
        "pictures": [{"view": "raw", "bytes": 3}, {"view": "steadied", "bytes": 5}],
        **{"latency": 0.0125, "fps": 29.97, "dropped": 3, "skipped": 2, "clients": 1},
        **{"playing": "playing", "recording": None},
    }


def test_what_is_unknown_is_null_and_what_is_no_number_never_reaches_a_browser():
    bare = step(
        frame=Frame(0, None, np.zeros((2, 2, 3), np.uint8)),
        motion=None,
        targets=(Target(1, "t", "#000000", Track((np.nan, 0, np.inf, 1), np.nan)),),
    )
    message = announcements.step_message(bare, [], skipped=0, clients=0)
    header, rest = header_of(message)
    assert (header["time"], header["motion"], rest) == (None, None, b"")
    assert b"NaN" not in message
    assert b"Infinity" not in message


def test_hello_tells_what_there_is():
    info = SessionInfo("browser", None, None, None, "lite", False, True)
    hello = json.loads(announcements.hello(info, SessionLimits(3), ServerLimits(message_bytes=9)))
    assert (hello["type"], hello["protocol"], hello["source"]) == ("hello", 1, "browser")
    assert [hello[name] for name in ("size", "fps", "length")] == [None] * 3
    assert hello["methods"] == ["off", "paper", "predict"]
    assert hello["limits"] == {"targets": 3, "message": 9, "picture": 4194304}
    known = SessionInfo("clip.mp4", (640, 360), 30000 / 1001, 900, "lite", True, False)
    hello = json.loads(announcements.hello(known, SessionLimits(), ServerLimits()))
    assert (hello["size"], hello["fps"], hello["length"]) == ([640, 360], 29.97, 900)


def test_other_errors_are_not_possible():
    for error, code in [
        (ArgumentError("no"), "not-possible"),
        (CommandError("too-old", "no"), "too-old"),
    ]:
        message = json.loads(announcements.refusal(None, error))
        assert message == {"type": "error", "ask": None, "code": code, "message": "no"}


def test_the_identity_is_whole():
    message = announcements.step_message(step(stab_from_raw=IDENTITY), [], skipped=0, clients=0)
    assert header_of(message)[0]["stab_from_raw"] == [[1, 0, 0], [0, 1, 0]]
