"""Feeds that are opened for a test, and the frames that they deliver."""

from __future__ import annotations

import time
from contextlib import contextmanager

from helpers.video_clips import number_in
from ssiam.web.feeds.opening import open_feed

TIMEOUT = 10.0  # seconds


def wait_for(condition):
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end, "timed out"
        time.sleep(0.005)


@contextmanager
def opened(spec, **options):
    notes = []
    feed = open_feed(str(spec), notify=notes.append, **options)
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
