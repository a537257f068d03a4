"""Valid and invalid messages of clients."""

import json

from helpers.synthetic import generator
from ssiam.web import Add, Advance, Hold, Pause, Record, Remove, Rename, Restart, Stabilize
from ssiam.web.server.incoming import Acknowledge, View

BOX = [1.5, 2, 30, 40]
GOOD = [
    # name, message, parsed content
    ("add", {"type": "add", "box": BOX}, Add((1.5, 2, 30, 40))),
    (
        "add into a step",
        {"type": "add", "box": BOX, "number": 812, "name": " the\n boat "},
        Add((1.5, 2, 30, 40), 812, "the boat"),
    ),
    (
        "add with nulls",
        {"type": "add", "box": BOX, "number": None, "name": None},
        Add((1.5, 2, 30, 40)),
    ),
    ("hold", {"type": "hold", "number": 1}, Hold(1)),
    ("remove", {"type": "remove", "id": 3}, Remove(3)),
    ("remove all", {"type": "remove"}, Remove()),
    ("rename", {"type": "rename", "id": 1, "name": "Größe 影"}, Rename(1, "Größe 影")),
    ("steady", {"type": "steady", "method": "off"}, Stabilize("off")),
    ("pause", {"type": "pause"}, Pause(True)),
    ("resume", {"type": "resume"}, Pause(False)),
    ("advance", {"type": "advance"}, Advance()),
    ("restart", {"type": "restart"}, Restart()),
    ("record", {"type": "record", "on": False}, Record(False)),
    (
        "view",
        {"type": "view", "raw": False, "steadied": True, "width": 64, "quality": 95},
        View(False, True, 64, 95),
    ),
    ("shown", {"type": "shown", "number": 9}, Acknowledge(9)),
    ("unknown field", {"type": "pause", "colour": [1, {}]}, Pause(True)),
]
# JSON values that a hostile client may send in any field.
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
    """Texts that resemble messages."""
    r = generator(seed)
    for _ in range(count):
        message = GOOD[r.integers(len(GOOD))][1]
        text, kind = json.dumps(message), r.integers(4)
        if kind == 0:  # odd values
            fields = r.choice([*list(message)[1:], "ask"], r.integers(1, 3))
            pairs = [f'"{name}":{ODD[r.integers(len(ODD))]}' for name in fields]
            yield text[:-1] + "," + ",".join(pairs) + "}"  # the last value of a field counts
        elif kind == 1:  # random characters
            letters = list(text)
            for _ in range(r.integers(1, 5)):
                letters[r.integers(len(letters))] = chr(r.integers(0x250))
            yield "".join(letters)
        elif kind == 2:  # a part repeated or missing
            at = r.integers(len(text))
            yield text[:at] + text[at - r.integers(at + 1) :]
        else:  # random bytes
            yield r.bytes(int(r.integers(60))).decode("latin-1")
