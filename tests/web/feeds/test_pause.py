"""Paused feeds, and single steps."""

from __future__ import annotations

import threading
import time

import pytest

from helpers.opened_feeds import TIMEOUT, indices, numbers, opened, rest, wait_for


@pytest.mark.parametrize("pace", ["clock", "fast"])
def test_a_paused_feed_advances_frame_by_frame(clip, pace):
    with opened(clip, pace=pace) as (feed, _):
        feed.advance()
        feed.take(TIMEOUT)
        feed.pause(True)
        dropped = feed.dropped
        assert feed.take(0.1) is None
        stepped = []
        for _ in range(4):
            asked = time.monotonic()
            feed.advance()
            feed.pause(True)
            stepped.append(feed.take(TIMEOUT))
            assert stepped[-1].arrived >= asked
            assert feed.take(0.03) is None
        # One frame was taken before.
        first = 1 + dropped
        assert indices(stepped) == numbers(stepped) == list(range(first, first + 4))
        assert feed.dropped == dropped
        asked = time.monotonic()
        feed.pause(False)
        arrivals = rest(feed)
        assert arrivals[0].arrived >= asked
        assert 5 + len(arrivals) + feed.dropped == 30
        assert pace == "clock" or feed.dropped == 0


def test_a_pause_delays_the_rest(clip):
    with opened(clip) as (feed, _):
        feed.take(TIMEOUT)
        feed.pause(True)
        time.sleep(0.3)
        resumed = time.monotonic()
        feed.pause(False)
        first, *_, last = rest(feed)
    # The 0.3 s are not caught up with; one frame may have been ready.
    assert last.arrived - resumed >= last.frame.time - first.frame.time - 0.1


def test_pause_before_the_last_frame(clip):
    with opened(clip, pace="fast") as (feed, _):
        while feed.take(TIMEOUT).frame.index < 28:
            pass
        feed.pause(True)
        feed.advance()
        assert feed.take(TIMEOUT).frame.index == 29
        wait_for(lambda: feed.state == "ended")
        feed.advance()
        assert feed.take(0.02) is None


@pytest.mark.parametrize("pace", ["clock", "fast"])
def test_close_wakes_a_waiting_consumer(clip, pace):
    with opened(clip, pace=pace) as (feed, _):
        feed.pause(True)
        consumer = threading.Thread(target=feed.take, args=(60,))
        consumer.start()
        feed.close()
        consumer.join(TIMEOUT)
        assert not consumer.is_alive()
        feed.close()
        assert feed.take(0) is None
