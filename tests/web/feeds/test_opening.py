"""`open_feed` on missing sources, files on a server and standard input."""

from __future__ import annotations

import subprocess

import pytest

from helpers.feed_servers import file_server
from helpers.opened_feeds import TIMEOUT, indices, opened, rest
from helpers.video_clips import python, y4m
from ssiam.errors import SourceError
from ssiam.web.feeds.opening import open_feed


@pytest.mark.parametrize("spec", ["nowhere.mp4", "99", "rtsp://anna:hunter2@127.0.0.1:9/live"])
def test_a_source_that_cannot_be_opened_raises_at_once(spec):
    with pytest.raises(SourceError) as caught:
        open_feed(spec, notify=lambda note: None)
    assert "hunter2" not in str(caught.value)


def test_a_file_on_a_server_is_seekable(clip):
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
from ssiam.web.types import CommandError
from ssiam.web.feeds.opening import open_feed
feed = open_feed("-", pace="fast", notify=print)
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
def test_standard_input_that_stays_open_does_not_block_the_exit(end):
    process = python(
        _READ_STDIN, *end, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdin.write(y4m(range(8)))
    process.stdin.flush()
    code = process.wait(TIMEOUT)
    printed = process.stdout.read().splitlines()
    assert printed == [b"0 1 2 3 4 5 6 7 not-possible False None", b"1"][: 2 - len(end)]
    assert (process.stderr.read(), code) == (b"", 0)
    for pipe in (process.stdin, process.stdout, process.stderr):
        pipe.close()
