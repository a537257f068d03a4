"""Times of a stream's frames (`StreamTime`) and due times of a file's (`PlayClock`)."""

from __future__ import annotations

import numpy as np
import pytest

from ssiam.video import Frame
from ssiam.web.feeds.paced import PlayClock
from ssiam.web.feeds.reconnecting import StreamTime

IMAGE = np.zeros((2, 2, 3), np.uint8)
STREAM_TIMES = [
    # name, (own time, arrival) of each frame (None: reconnection), expected times
    ("own times", [(5.0, 100.0), (5.1, 100.3), (5.2, 100.31)], [0, 0.1, 0.2]),
    ("no times", [(None, 100.0), (None, 100.5)], [0, 0.5]),
    ("no first time", [(None, 100.0), (0.0, 100.1), (0.4, 100.2)], [0, 0.1, 0.5]),
    ("goes back", [(5.0, 100.0), (5.1, 100.1), (0.0, 100.2), (0.1, 100.4)], [0, 0.1, 0.2, 0.4]),
    ("jumps", [(0.0, 100.0), (900.0, 100.1), (900.1, 100.3)], [0, 0.1, 0.3]),
    ("wrong rate", [(i * 1.0, 100 + i * 3.0) for i in range(4)], [0, 1, 4, 7]),
    ("reconnection", [(7.0, 100.0), None, (0.0, 104.0), (0.2, 104.1)], [0, 4, 4.2]),
]


@pytest.mark.parametrize(
    ("frames", "expected"), [s[1:] for s in STREAM_TIMES], ids=[s[0] for s in STREAM_TIMES]
)
def test_stream_time(frames, expected):
    stream = StreamTime()
    numbered = []
    for given in frames:
        if given is None:
            stream.reconnect()
            continue
        numbered.append(stream.renumber(Frame(0, given[0], IMAGE), given[1]))
    assert [frame.time for frame in numbered] == pytest.approx(expected)
    assert [frame.index for frame in numbered] == list(range(len(expected)))


PLAY_TIMES = [
    # name, (own time, now) of each frame, seconds until it is due
    ("on time", [(0.0, 50.0), (0.5, 50.1), (1.0, 50.7)], [0, 0.4, 0.3]),
    ("a little late", [(0.0, 50.0), (0.1, 50.9), (1.0, 50.9)], [0, -0.8, 0.1]),
    ("much too late", [(0.0, 50.0), (0.1, 99.0), (0.2, 99.0)], [0, 0, 0.1]),
    ("goes back", [(9.0, 50.0), (0.0, 50.1), (0.2, 50.2)], [0, 0, 0.1]),
    ("jumps", [(0.0, 50.0), (99.0, 50.1), (99.2, 50.2)], [0, 0, 0.1]),
    ("no times", [(None, 50.0), (None, 50.01), (None, 50.01)], [0, 0.09, 0.19]),
]


@pytest.mark.parametrize(
    ("frames", "expected"), [p[1:] for p in PLAY_TIMES], ids=[p[0] for p in PLAY_TIMES]
)
def test_play_clock(frames, expected):
    clock = PlayClock(10.0)
    waits = [
        clock.seconds_until(Frame(index, time, IMAGE), now)
        for index, (time, now) in enumerate(frames)
    ]
    assert waits == pytest.approx(expected)
    clock.delay(2.0)
    last = Frame(len(frames) - 1, *frames[-1][:1], IMAGE)
    assert clock.seconds_until(last, frames[-1][1]) == pytest.approx(expected[-1] + 2.0)
