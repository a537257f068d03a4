"""Parsing of the clients' messages of docs/reference/live-protocol.md."""

import json
import math

import pytest

from helpers.message_fuzz import GOOD, fuzzed
from ssiam.web import Add, Rename
from ssiam.web.server import outgoing
from ssiam.web.server.incoming import BadMessage, Message, View, parse_message

BOX = [1.5, 2, 30, 40]
VIEW = {"type": "view", "raw": True, "steadied": True, "width": 960, "quality": 80}
BAD = [
    # name, message as an object or as text
    ("nothing", ""),
    ("not JSON", "{"),
    ("a list", "[]"),
    ("a number", "7"),
    ("null", "null"),
    ("no type", "{}"),
    ("type is a list", {"type": ["pause"]}),
    ("type is an object", {"type": {}}),
    ("unknown type", {"type": "shutdown"}),
    ("type of a server message", {"type": "hello"}),
    ("deep list", "[" * 60_000),
    ("deep object", '{"a":' * 10_000),
    ("deep field", '{"type":"pause","a":' + "[" * 30_000),
    ("NaN", '{"type":"add","box":[NaN,1,2,3]}'),
    ("Infinity", '{"type":"add","box":[1,1,Infinity,3]}'),
    ("-Infinity in an unknown field", '{"type":"pause","a":-Infinity}'),
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
    ("right-to-left override", {"type": "rename", "id": 1, "name": "a\u202eb"}),
    ("unknown method", {"type": "steady", "method": "literal"}),
    ("unknown camera", {"type": "camera", "camera": "raw"}),
    ("no camera", {"type": "camera"}),
    ("method is a list", {"type": "steady", "method": ["off"]}),
    ("on is a number", {"type": "record", "on": 1}),
    ("no index", {"type": "seek"}),
    ("index below 0", {"type": "seek", "index": -1}),
    ("index is a float", {"type": "seek", "index": 1.5}),
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
def test_a_valid_message_is_parsed(message, content):
    assert parse_message(json.dumps(message)) == Message(content)
    for ask in (0, 2**31):
        assert parse_message(json.dumps(message | {"ask": ask})) == Message(content, ask)


@pytest.mark.parametrize("message", [b[1] for b in BAD], ids=[b[0] for b in BAD])
def test_an_invalid_message_is_refused_in_one_short_line(message):
    with pytest.raises(BadMessage) as caught:
        parse_message(as_text(message))
    assert caught.value.code == "bad-message"
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("box", [[1, 2, 0, 4], [1, 2, 3, -4], [1e7, 2, 3, 4], [1, 2, 3, 1e9]])
def test_an_invalid_box_has_its_own_code(box):
    with pytest.raises(BadMessage) as caught:
        parse_message(json.dumps({"type": "add", "box": box, "ask": 5}))
    assert (caught.value.code, caught.value.ask) == ("bad-box", 5)


def test_the_error_of_an_invalid_message_has_its_ask():
    with pytest.raises(BadMessage) as caught:
        parse_message('{"type": "remove", "id": "x", "ask": 12}')
    assert caught.value.ask == 12


def test_half_of_a_surrogate_pair_is_refused_where_it_is_used_only():
    message = {"type": "rename", "id": 1, "name": "\ud800", "ask": 12}
    with pytest.raises(BadMessage) as caught:
        parse_message(json.dumps(message))
    assert caught.value.ask == 12
    assert parse_message(json.dumps({"type": "pause", "x": "\ud800", "ask": 3})).ask == 3


def test_any_text_is_parsed_or_refused():
    outcomes = {"parsed": 0, "bad-message": 0, "bad-box": 0}
    for text in fuzzed(seed=20, count=12_000):
        try:
            message = parse_message(text)
        except BadMessage as error:
            outcomes[error.code] += 1
            outgoing.error_message(error.ask, error).encode()
            continue
        outcomes["parsed"] += 1
        check(message)
    assert min(outcomes.values()) > 3, outcomes


def check(message):
    """Check that all values are in range."""
    content = message.content
    assert message.ask is None or (type(message.ask) is int and 0 <= message.ask <= 2**31)
    for name in ("number", "id"):
        value = getattr(content, name, None)
        assert value is None or (type(value) is int and 1 <= value <= 2**53)
    if isinstance(content, Add):
        assert all(type(v) is float and math.isfinite(v) for v in content.xywh)
        assert min(content.xywh[2:]) > 0
    if isinstance(content, View):
        assert type(content.raw) is type(content.stabilized) is bool
        assert 64 <= content.width <= 4096
        assert 30 <= content.quality <= 95
    if isinstance(content, (Add, Rename)) and content.name is not None:
        assert content.name.encode()
        assert len(content.name) <= 40
