"""Feeds that stand still, and go on frame by frame."""

from __future__ import annotations

import threading
import time

import pytest

from helpers.opened_feeds import SOON, indices, numbers, opened, rest, wait_for


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
