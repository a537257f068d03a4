"""A real RTSP server that is killed, restarted, changes its frame size, and stalls."""

from __future__ import annotations

import signal
import threading
import time
from itertools import pairwise

import pytest

from helpers.rtsp import TIMEOUT, RtspServer, missing_rtsp, wait_for
from helpers.video_clips import number_in, numbered_image
from ssiam.video import VideoSink
from ssiam.web.feeds.opening import open_feed

# Seconds within which frames must arrive after the server is back.
RECONNECT_LIMIT = 3.0
# Seconds within which a silent server must be detected.
SILENCE_LIMIT = 8.0


@pytest.fixture(scope="module", autouse=True)
def _server_can_run():
    if reason := missing_rtsp():
        pytest.skip(reason)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A function that makes a clip of 50 numbered frames at 25 frames per second."""

    def make(width, height):
        path = tmp_path_factory.mktemp("rtsp") / "clip.mp4"
        with VideoSink(path, 25) as sink:
            for number in range(50):
                sink.write(numbered_image(number, width, height))
        return path

    return make


def play(server, notes):
    feed = open_feed(server.address, notify=notes.append)
    arrivals = [feed.take(TIMEOUT) for _ in range(20)]
    assert (feed.length, feed.seekable, feed.fps, feed.size_wh) == (None, False, 25, (320, 240))
    return feed, arrivals


def check_order(arrivals):
    for earlier, later in pairwise(arrivals):
        assert later.frame.index > earlier.frame.index
        assert later.frame.time > earlier.frame.time
        assert later.arrived > earlier.arrived


@pytest.mark.parametrize(
    ("size", "change"),
    [((320, 240), ""), ((160, 112), ", now with 160x112 pixels")],
    ids=["same size", "another size"],
)
def test_a_server_that_is_killed_is_reconnected(clip, size, change):
    notes = []
    with RtspServer().start(clip(320, 240)) as server:
        feed, arrivals = play(server, notes)
        server.kill()
        wait_for(lambda: feed.state == "reconnecting")
        while (left := feed.take(0)) is not None:
            arrivals.append(left)
        # Longer than the maximum wait between two attempts.
        time.sleep(1.2)
        assert feed.state == "reconnecting"
        server.start(clip(*size))
        back = time.monotonic()
        arrivals += [feed.take(TIMEOUT) for _ in range(5)]
        assert arrivals[-5].arrived - back < RECONNECT_LIMIT
        assert (feed.state, feed.size_wh) == ("playing", size)
        assert number_in(arrivals[-1].frame.image) < 50
        feed.close()
    check_order(arrivals)
    # The times include the gap.
    assert arrivals[-1].frame.time - arrivals[-6].frame.time > 1.2
    name = f"rtsp://127.0.0.1:{server.port}/clip"
    assert [note.message for note in notes] == [
        f"{name}: connection lost; trying to reconnect",
        f"{name}: reconnected{change}",
    ]
    assert [note.level for note in notes] == ["warning", "warning" if change else "info"]
    wait_for(lambda: "ssiam-feed" not in [thread.name for thread in threading.enumerate()])


def test_a_silent_server_is_reconnected(clip):
    notes = []
    with RtspServer().start(clip(320, 240)) as server:
        feed, arrivals = play(server, notes)
        server.signal(signal.SIGSTOP)
        silent = time.monotonic()
        wait_for(lambda: feed.state == "reconnecting")
        assert time.monotonic() - silent < SILENCE_LIMIT
        while (left := feed.take(0)) is not None:
            arrivals.append(left)
        server.signal(signal.SIGCONT)
        back = time.monotonic()
        arrivals += [feed.take(TIMEOUT) for _ in range(5)]
        assert arrivals[-5].arrived - back < RECONNECT_LIMIT
        # The thread ends too if the feed is closed while the server is silent.
        server.signal(signal.SIGSTOP)
        feed.close()
        wait_for(lambda: "ssiam-feed" not in [thread.name for thread in threading.enumerate()])
        assert feed.take(0) is None
    check_order(arrivals)
    assert [note.level for note in notes] == ["warning", "info"]
    assert not any("secret" in note.message for note in notes)
