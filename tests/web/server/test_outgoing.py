"""The server's messages of docs/reference/live-protocol.md."""

import json
import struct

import numpy as np
import pytest

from ssiam.errors import ArgumentError
from ssiam.geometry import IDENTITY, frame_center, rigid
from ssiam.motion import Motion
from ssiam.track import Track
from ssiam.video import Frame
from ssiam.web.server import outgoing
from ssiam.web.server.limits import ServerLimits
from ssiam.web.types import CommandError, SessionInfo, SessionLimits, Step, Target


def step(**options):
    frame = Frame(811, 27.03, np.zeros((36, 64, 3), np.uint8))
    turn = rigid(3, -2, 0.01, frame_center((64, 36)))
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
        "playback": "playing",
    }
    return Step(**(values | options))


def header_of(message):
    (length,) = struct.unpack_from(">I", message)
    return json.loads(message[4 : 4 + length]), message[4 + length :]


def test_a_step_is_a_header_and_images():
    images = [("raw", b"abc"), ("steadied", b"defgh")]
    message = outgoing.step_message(step(), images, skipped=2, clients=1)
    header, rest = header_of(message)
    assert rest == b"abcdefgh"
    assert header.pop("motion") == pytest.approx(
        {"dx": 3, "dy": -2, "angle": 0.01, "inliers": 0.8, "reliable": True}
    )
    turn = rigid(3, -2, 0.01, frame_center((64, 36)))
    assert np.allclose(header.pop("stab_from_raw"), turn[:2], atol=1e-7)
    boat, half = header.pop("targets")
    assert boat == {
        **{"id": 1, "name": "boat", "colour": "#5ae63c", "box": [1, 2, 3, 4.1235]},
        **{"corners": None, "score": 0.93, "lost": False, "found": False},
        **{"error": None},
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
            "camera": "stabilized",
        },
        "pictures": [{"view": "raw", "bytes": 3}, {"view": "steadied", "bytes": 5}],
        **{"latency": 0.0125, "fps": 29.97, "dropped": 3, "skipped": 2, "clients": 1},
        **{"playing": "playing", "recording": None, "error": None, "waiting": []},
    }


def test_unknown_values_are_null_and_nan_is_not_sent():
    bare = step(
        frame=Frame(0, None, np.zeros((2, 2, 3), np.uint8)),
        motion=None,
        targets=(Target(1, "t", "#000000", Track((np.nan, 0, np.inf, 1), np.nan)),),
    )
    message = outgoing.step_message(bare, [], skipped=0, clients=0)
    header, rest = header_of(message)
    assert (header["time"], header["motion"], rest) == (None, None, b"")
    assert b"NaN" not in message
    assert b"Infinity" not in message


def test_hello():
    info = SessionInfo("browser", None, None, None, "lite", False, True)
    hello = json.loads(
        outgoing.hello_message(info, SessionLimits(3), ServerLimits(message_bytes=9))
    )
    assert (hello["type"], hello["protocol"], hello["source"]) == ("hello", 1, "browser")
    assert [hello[name] for name in ("size", "fps", "length")] == [None] * 3
    assert hello["methods"] == ["off", "paper", "predict"]
    assert hello["limits"] == {"targets": 3, "message": 9, "picture": 4194304}
    known = SessionInfo("clip.mp4", (640, 360), 30000 / 1001, 900, "lite", True, False)
    hello = json.loads(outgoing.hello_message(known, SessionLimits(), ServerLimits()))
    assert (hello["size"], hello["fps"], hello["length"]) == ([640, 360], 29.97, 900)


def test_errors_without_a_code_are_sent_as_not_possible():
    for error, code in [
        (ArgumentError("no"), "not-possible"),
        (CommandError("too-old", "no"), "too-old"),
    ]:
        message = json.loads(outgoing.error_message(None, error))
        assert message == {"type": "error", "ask": None, "code": code, "message": "no"}


def test_the_identity_is_sent_as_integers():
    message = outgoing.step_message(step(stab_from_raw=IDENTITY), [], skipped=0, clients=0)
    assert header_of(message)[0]["stab_from_raw"] == [[1, 0, 0], [0, 1, 0]]
