"""Messages of clients as they should be, and as they should not."""

import json

from helpers.synthetic import generator
from ssiam.web import commands
from ssiam.web.server.messages import Shown, View

BOX = [1.5, 2, 30, 40]
GOOD = [
    # name, message, what it is read as
    ("add", {"type": "add", "box": BOX}, commands.Add((1.5, 2, 30, 40))),
    (
        "add into a step",
        {"type": "add", "box": BOX, "number": 812, "name": " the\n boat "},
        commands.Add((1.5, 2, 30, 40), 812, "the boat"),
    ),
    (
        "add with nulls",
        {"type": "add", "box": BOX, "number": None, "name": None},
        commands.Add((1.5, 2, 30, 40)),
    ),
    ("hold", {"type": "hold", "number": 1}, commands.Hold(1)),
    ("remove", {"type": "remove", "id": 3}, commands.Remove(3)),
    ("remove all", {"type": "remove"}, commands.Remove()),
    ("rename", {"type": "rename", "id": 1, "name": "Größe 影"}, commands.Rename(1, "Größe 影")),
    ("steady", {"type": "steady", "method": "off"}, commands.Steady("off")),
    ("pause", {"type": "pause"}, commands.Pause(True)),
    ("resume", {"type": "resume"}, commands.Pause(False)),
    ("advance", {"type": "advance"}, commands.Advance()),
    ("restart", {"type": "restart"}, commands.Restart()),
    ("record", {"type": "record", "on": False}, commands.Record(False)),
    (
        "view",
        {"type": "view", "raw": False, "steadied": True, "width": 64, "quality": 95},
        View(False, True, 64, 95),
    ),
    ("shown", {"type": "shown", "number": 9}, Shown(9)),
    ("unknown field", {"type": "pause", "colour": [1, {}]}, commands.Pause(True)),
]
# Values that a field may be given by somebody who means no good.
ODD = [
    *("null", "true", "false", "0", "-1", "1", "1.5", "1e999", "-0.0", "2147483649", "NaN"),
    *(
        '""',
        '"off"',
        '"\\u0000"',
        '"\\udc00"',
        "[]",
        "{}",
        "[[[]]]",
        "[1,2,3,4]",
        "[1,2,0,4]",
        "9" * 400,
    ),
]


def fuzzed(seed, count):
    """Texts that are nearly messages."""
    r = generator(seed)
    for _ in range(count):
        whole = GOOD[r.integers(len(GOOD))][1]
        text, kind = json.dumps(whole), r.integers(4)
        if kind == 0:  # other values
            chosen = r.choice([*list(whole)[1:], "ask"], r.integers(1, 3))
            pairs = [f'"{name}":{ODD[r.integers(len(ODD))]}' for name in chosen]
            yield text[:-1] + "," + ",".join(pairs) + "}"  # of two values the last one counts
        elif kind == 1:  # other characters
            letters = list(text)
            for _ in range(r.integers(1, 5)):
                letters[r.integers(len(letters))] = chr(r.integers(0x250))
            yield "".join(letters)
        elif kind == 2:  # cut, or said twice
            at = r.integers(len(text))
            yield text[:at] + text[at - r.integers(at + 1) :]
        else:  # noise
            yield r.bytes(int(r.integers(60))).decode("latin-1")
