"""Feeds: newest frames only, standing still, beginning again, finding a stream again."""

from __future__ import annotations

import subprocess
import threading
import time
from contextlib import contextmanager
from fractions import Fraction

import cv2
import numpy as np
import pytest
from clips import cut, number_in, picture, python, write_clip, y4m
from feed_servers import JpegCamera, file_server

from ssiam.errors import ArgumentError, SourceError
from ssiam.video import Frame
from ssiam.video.cameras import open_capture
from ssiam.web.errors import CommandError
from ssiam.web.feeds.feed import open_feed
from ssiam.web.feeds.pacing import PlayClock
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.feeds.reconnecting import ReconnectingFeed, StreamTime

SOON = 10.0


@pytest.fixture(autouse=True)
def _no_thread_is_left():
    yield
    wait_for(lambda: not [t for t in threading.enumerate() if t.name == "ssiam-feed"])


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """30 frames at 50 a second."""
    return write_clip(tmp_path_factory.mktemp("clip") / "clip.mp4", 30, rate=Fraction(50))


def wait_for(condition):
    end = time.monotonic() + SOON
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


@contextmanager
def opened(spec, **options):
    notes = []
    feed = open_feed(str(spec), notes=notes.append, **options)
    try:
        yield feed, notes
    finally:
        feed.close()


def rest(feed):
    """All arrivals until the feed has ended."""
    arrivals = []
    while feed.state != "ended":
        arrival = feed.take(0.02)
        if arrival is not None:
            arrivals.append(arrival)
    return arrivals


def indices(arrivals):
    return [arrival.frame.index for arrival in arrivals]


def numbers(arrivals):
    return [number_in(arrival.frame.image) for arrival in arrivals]


def _folder(path):
    path.mkdir()
    for number in range(30):
        cv2.imwrite(str(path / f"{number}.png"), picture(number))
    return path


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_at_the_takers_pace_every_frame_comes(tmp_path, clip, kind):
    spec = clip if kind == "file" else _folder(tmp_path / "folder")
    with opened(spec, pace="fast") as (feed, notes):
        assert (feed.name, feed.size_wh, feed.length) == (str(spec), (160, 96), 30)
        assert feed.fps == (50 if kind == "file" else 30)
        assert feed.seekable
        arrivals = rest(feed)
        assert numbers(arrivals) == indices(arrivals) == list(range(30))
        assert (feed.dropped, feed.state, feed.take(0), notes) == (0, "ended", None, [])


def test_at_its_own_pace_no_frame_comes_early(tmp_path):
    seconds = [0, 0.02, 0.04, 0.2, 0.22, 0.5]
    spec = write_clip(tmp_path / "vfr.mp4", 6, rate=Fraction(50), seconds=seconds)
    began = time.monotonic()
    with opened(spec) as (feed, _):
        arrivals = rest(feed)
    for arrival in arrivals:
        assert arrival.arrived >= began + arrival.frame.time
    assert arrivals[-1].frame.index == 5


def test_whoever_is_slow_gets_the_newest_and_the_rest_is_counted(clip):
    with opened(clip) as (feed, _):
        first = feed.take(SOON)
        wait_for(lambda: feed.dropped >= 5)
        second = feed.take(SOON)
        assert second.frame.index - first.frame.index > 5
        assert number_in(second.frame.image) == second.frame.index
        taken = [first, second, *rest(feed)]
        assert len(taken) + feed.dropped == 30
        assert taken[-1].frame.index == 29


def test_nobody_takes_and_the_last_frame_is_kept(clip):
    with opened(clip) as (feed, _):
        wait_for(lambda: feed.dropped == 29)
        assert feed.state == "playing"
        assert feed.take(SOON).frame.index == 29
        wait_for(lambda: feed.state == "ended")


@pytest.mark.parametrize("pace", ["clock", "fast"])
def test_paused_it_goes_on_frame_by_frame(clip, pace):
    with opened(clip, pace=pace) as (feed, _):
        feed.advance()
        feed.take(SOON)
        feed.pause(True)
        dropped = feed.dropped
        assert feed.take(0.1) is None
        stepped = []
        for _ in range(4):
            asked = time.monotonic()
            feed.advance()
            feed.pause(True)
            stepped.append(feed.take(SOON))
            assert stepped[-1].arrived >= asked
            assert feed.take(0.03) is None
        # One frame had been taken.
        first = 1 + dropped
        assert indices(stepped) == numbers(stepped) == list(range(first, first + 4))
        assert feed.dropped == dropped
        asked = time.monotonic()
        feed.pause(False)
        arrivals = rest(feed)
        assert arrivals[0].arrived >= asked
        assert 5 + len(arrivals) + feed.dropped == 30
        assert pace == "clock" or feed.dropped == 0


def test_a_pause_is_not_caught_up_with(clip):
    with opened(clip) as (feed, _):
        feed.take(SOON)
        feed.pause(True)
        time.sleep(0.3)
        resumed = time.monotonic()
        feed.pause(False)
        first, *_, last = rest(feed)
    # Without the 0.3 s; one frame may have been ready.
    assert last.arrived - resumed >= last.frame.time - first.frame.time - 0.1


def test_paused_at_its_end(clip):
    with opened(clip, pace="fast") as (feed, _):
        while feed.take(SOON).frame.index < 28:
            pass
        feed.pause(True)
        feed.advance()
        assert feed.take(SOON).frame.index == 29
        wait_for(lambda: feed.state == "ended")
        feed.advance()
        assert feed.take(0.02) is None


@pytest.mark.parametrize("when", ["in the middle", "after the end", "while paused"])
@pytest.mark.parametrize("pace", ["clock", "fast"])
def test_restart(clip, pace, when):
    with opened(clip, pace=pace) as (feed, notes):
        feed.take(SOON)
        if when == "after the end":
            rest(feed)
            assert feed.state == "ended"
        feed.pause(when == "while paused")
        before = feed.dropped
        feed.restart()
        assert feed.state == "playing"
        first = feed.take(SOON)
        # Every frame of this run was dropped or is this one.
        assert first.frame.index <= feed.dropped - before
        if when == "while paused":
            assert first.frame.index == number_in(first.frame.image) == 0
            assert feed.take(0.05) is None
            feed.pause(False)
        arrivals = [first, *rest(feed)]
        assert numbers(arrivals) == indices(arrivals) == sorted(set(indices(arrivals)))
        assert arrivals[-1].frame.index == 29
        if pace == "fast":
            assert len(arrivals) == 30
        assert len(arrivals) + feed.dropped - before >= 30
        assert notes == []


def test_restart_of_a_file_that_is_gone(clip, tmp_path):
    path = tmp_path / "gone.mp4"
    path.write_bytes(clip.read_bytes())
    with opened(path, pace="fast") as (feed, _):
        feed.take(SOON)
        path.unlink()
        with pytest.raises(SourceError, match=r"gone\.mp4: no such file"):
            feed.restart()
        assert indices(rest(feed)) == list(range(1, 30))


def _in_order(path):
    """A clip whose pictures are stored in the order of time."""
    return write_clip(path, 60, codec_options={"bf": "0"})


def _joined(path):
    small = write_clip(path / "a.ts", 10)
    large = write_clip(path / "b.ts", 10, size=(320, 192))
    joined = path / "joined.ts"
    joined.write_bytes(small.read_bytes() + large.read_bytes())
    return joined


BROKEN = [
    ("cut file", lambda path: cut(_in_order(path / "clip.mkv"), 0.5), "broke off after"),
    ("another size in the middle", _joined, "frame 10"),
]


@pytest.mark.parametrize(("make", "words"), [b[1:] for b in BROKEN], ids=[b[0] for b in BROKEN])
def test_a_file_that_breaks_off_ends_with_a_note(tmp_path, make, words):
    spec = make(tmp_path)
    with opened(spec, pace="fast") as (feed, notes):
        arrivals = rest(feed)
        assert numbers(arrivals) == list(range(len(arrivals)))
        assert len(arrivals) >= 10
        assert [note.level for note in notes] == ["error"]
        assert notes[0].message.startswith(str(spec))
        assert words in notes[0].message
        feed.restart()
        assert feed.take(SOON).frame.index == 0


@pytest.mark.parametrize("spec", ["nowhere.mp4", "99", "rtsp://anna:hunter2@127.0.0.1:9/live"])
def test_what_cannot_be_opened_fails_at_once(spec):
    with pytest.raises(SourceError) as caught:
        open_feed(spec, notes=lambda note: None)
    assert "hunter2" not in str(caught.value)


def test_a_file_on_a_server_is_a_file(clip):
    with (
        file_server(clip.parent) as address,
        opened(f"{address}/{clip.name}", pace="fast") as (feed, _),
    ):
        assert (feed.length, feed.seekable) == (30, True)
        assert indices(rest(feed)) == list(range(30))
        feed.restart()
        assert indices(rest(feed)) == list(range(30))


_READ_STDIN = """
import sys
import threading
from ssiam.web.errors import CommandError
from ssiam.web.feeds.feed import open_feed
feed = open_feed("-", pace="fast", notes=print)
for _ in range(8):
    print(feed.take(10).frame.index, end=" ")
try:
    feed.restart()
except CommandError as error:
    print(error.code, feed.seekable, feed.take(0.1), flush=True)
if len(sys.argv) == 1:
    feed.close()
    print(threading.active_count())
"""


@pytest.mark.parametrize("end", [(), ("without close",)], ids=["closed", "not closed"])
def test_standard_input_that_stays_open_holds_nobody_up(end):
    process = python(
        _READ_STDIN, *end, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdin.write(y4m(range(8)))
    process.stdin.flush()
    code = process.wait(SOON)
    told = process.stdout.read().splitlines()
    assert told == [b"0 1 2 3 4 5 6 7 not-possible False None", b"1"][: 2 - len(end)]
    assert (process.stderr.read(), code) == (b"", 0)
    for pipe in (process.stdin, process.stdout, process.stderr):
        pipe.close()


@pytest.mark.parametrize("pace", ["clock", "fast"])
def test_closed_while_it_waits(clip, pace):
    with opened(clip, pace=pace) as (feed, _):
        feed.pause(True)
        taker = threading.Thread(target=feed.take, args=(60,))
        taker.start()
        feed.close()
        taker.join(SOON)
        assert not taker.is_alive()
        feed.close()
        assert feed.take(0) is None


# ---------------------------------------------------------------------------- live sources


def test_a_camera_is_read_while_paused_and_its_newest_frame_comes():
    camera = JpegCamera()
    with camera.on_air() as address, opened(address) as (feed, _):
        assert (feed.length, feed.seekable, feed.size_wh) == (None, False, (160, 96))
        feed.take(SOON)
        feed.pause(True)
        dropped, sent = feed.dropped, camera.sent
        wait_for(lambda: camera.sent > sent + 30)
        assert feed.take(0) is None
        # It reads what has been sent, and notices then.
        camera.hang_up()
        wait_for(lambda: feed.state == "reconnecting")
        feed.advance()
        stepped = feed.take(SOON)
        assert stepped.frame.index == number_in(stepped.frame.image) == camera.sent - 1
        assert feed.take(0.03) is None
        assert feed.dropped == dropped
        camera.come_back()
        feed.pause(False)
        assert feed.take(SOON).frame.index > stepped.frame.index
        with pytest.raises(CommandError, match="cannot be started again") as caught:
            feed.restart()
        assert caught.value.code == "not-possible"


def test_a_camera_that_hangs_up_is_found_again():
    camera = JpegCamera()
    with camera.on_air() as address, opened(address) as (feed, notes):
        seen = [feed.take(SOON) for _ in range(5)]
        for size in ((160, 96), (320, 192)):
            camera.hang_up()
            wait_for(lambda: feed.state == "reconnecting")
            camera.come_back(size)
            wait_for(lambda: feed.state == "playing")
            seen += [feed.take(SOON) for _ in range(5)]
            assert feed.size_wh == size == seen[-1].frame.image.shape[1::-1]
        assert indices(seen) == sorted(set(indices(seen)))
        times = [arrival.frame.time for arrival in seen]
        assert all(step > 0 for step in np.diff(times))
        # Waiting for it took its time.
        assert times[-1] > 0.5
        name = address.split("?")[0].replace("anna:hunter2@", "")
        assert [(note.level, note.message) for note in notes] == [
            ("warning", f"{name} is gone; trying again until it is back"),
            ("info", f"{name} is back"),
            ("warning", f"{name} is gone; trying again until it is back"),
            ("warning", f"{name} is back, now with 320x192 pixels"),
        ]


def test_closed_while_reconnecting():
    camera = JpegCamera()
    with camera.on_air() as address, opened(address) as (feed, notes):
        feed.take(SOON)
        camera.hang_up()
        wait_for(lambda: feed.state == "reconnecting")
        feed.close()
        feed.close()
        assert len(notes) == 1


def test_a_camera_that_was_unplugged_is_found_again(clip):
    def plugged_in():
        return open_capture("camera 7", cv2.VideoCapture(str(clip)))

    notes, tries = [], []

    def reopen():
        tries.append(1)
        if len(tries) != 2:
            raise SourceError("camera 7: there is no such camera")
        return plugged_in()

    feed = ReconnectingFeed(plugged_in(), notes.append, reopen)
    wait_for(lambda: len(notes) == 3)
    assert feed.take(SOON).frame.index == 59
    feed.close()
    assert [note.level for note in notes] == ["warning", "info", "warning"]


def test_segments_are_played_at_their_pace(tmp_path):
    playlist = write_clip(
        tmp_path / "live.m3u8",
        30,
        rate=Fraction(50),
        options={"hls_time": "0.2", "hls_list_size": "0"},
        codec_options={"g": "10"},
    )
    # Without its last line it is the playlist of a stream that goes on.
    playlist.write_text(playlist.read_text().replace("#EXT-X-ENDLIST\n", ""))
    began = time.monotonic()
    with file_server(tmp_path) as address, opened(f"{address}/live.m3u8") as (feed, _):
        arrivals = [feed.take(SOON) for _ in range(8)]
        for arrival in arrivals:
            assert arrival.arrived >= began + arrival.frame.time
        assert feed.length is None


IMAGE = np.zeros((2, 2, 3), np.uint8)

STREAM_TIMES = [
    # name, (time told, arrival) of each frame, times that come out; None: another connection
    ("its own", [(5.0, 100.0), (5.1, 100.3), (5.2, 100.31)], [0, 0.1, 0.2]),
    ("none told", [(None, 100.0), (None, 100.5)], [0, 0.5]),
    ("first one not told", [(None, 100.0), (0.0, 100.1), (0.4, 100.2)], [0, 0.1, 0.5]),
    ("goes back", [(5.0, 100.0), (5.1, 100.1), (0.0, 100.2), (0.1, 100.4)], [0, 0.1, 0.2, 0.4]),
    ("jumps", [(0.0, 100.0), (900.0, 100.1), (900.1, 100.3)], [0, 0.1, 0.3]),
    ("of a wrong rate", [(i * 1.0, 100 + i * 3.0) for i in range(4)], [0, 1, 4, 7]),
    ("over a gap", [(7.0, 100.0), None, (0.0, 104.0), (0.2, 104.1)], [0, 4, 4.2]),
]


@pytest.mark.parametrize(
    ("frames", "expected"), [s[1:] for s in STREAM_TIMES], ids=[s[0] for s in STREAM_TIMES]
)
def test_stream_time(frames, expected):
    stream = StreamTime()
    numbered = []
    for given in frames:
        if given is None:
            stream.reconnected()
            continue
        numbered.append(stream.numbered(Frame(0, given[0], IMAGE), given[1]))
    assert [frame.time for frame in numbered] == pytest.approx(expected)
    assert [frame.index for frame in numbered] == list(range(len(expected)))


PLAY_TIMES = [
    # name, (time told, now) of each frame, seconds until it is due
    ("on time", [(0.0, 50.0), (0.5, 50.1), (1.0, 50.7)], [0, 0.4, 0.3]),
    ("a little late is caught up with", [(0.0, 50.0), (0.1, 50.9), (1.0, 50.9)], [0, -0.8, 0.1]),
    ("much too late begins anew", [(0.0, 50.0), (0.1, 99.0), (0.2, 99.0)], [0, 0, 0.1]),
    ("goes back", [(9.0, 50.0), (0.0, 50.1), (0.2, 50.2)], [0, 0, 0.1]),
    ("leaps", [(0.0, 50.0), (99.0, 50.1), (99.2, 50.2)], [0, 0, 0.1]),
    ("no times", [(None, 50.0), (None, 50.01), (None, 50.01)], [0, 0.09, 0.19]),
]


@pytest.mark.parametrize(
    ("frames", "expected"), [p[1:] for p in PLAY_TIMES], ids=[p[0] for p in PLAY_TIMES]
)
def test_play_clock(frames, expected):
    clock = PlayClock(10.0)
    waits = [
        clock.seconds_until(Frame(index, told, IMAGE), now)
        for index, (told, now) in enumerate(frames)
    ]
    assert waits == pytest.approx(expected)
    clock.delay(2.0)
    last = Frame(len(frames) - 1, *frames[-1][:1], IMAGE)
    assert clock.seconds_until(last, frames[-1][1]) == pytest.approx(expected[-1] + 2.0)


# ---------------------------------------------------------------------------- a browser


def test_pushed_pictures():
    feed = open_feed("browser", notes=lambda note: None)
    assert isinstance(feed, PushedFeed)
    told = feed.name, feed.size_wh, feed.fps, feed.length, feed.seekable, feed.state
    assert told == ("browser", None, None, None, False, "playing")
    assert feed.take(0) is None
    for number in range(4):
        feed.push(picture(number))
        time.sleep(0.01)
    assert feed.dropped == 3
    assert 0 < feed.fps <= 100
    arrival = feed.take(0)
    assert number_in(arrival.frame.image) == arrival.frame.index == 3
    assert 0.03 <= arrival.frame.time <= arrival.arrived
    feed.push(picture(4, 320, 192))
    assert feed.size_wh == (320, 192)
    assert feed.take(0).frame.image.shape == (192, 320, 3)
    feed.close()
    feed.push(picture(5))
    assert feed.take(0) is None


def test_a_push_wakes_who_waits():
    feed = PushedFeed()
    pusher = threading.Timer(0.05, feed.push, [picture(9)])
    pusher.start()
    assert feed.take(SOON).frame.index == 0
    feed.close()


@pytest.mark.parametrize("image", [np.zeros((4, 4), np.uint8), np.zeros((0, 4, 3), np.uint8), None])
def test_pushed_nonsense_is_refused(image):
    with pytest.raises(ArgumentError):
        PushedFeed().push(image)
