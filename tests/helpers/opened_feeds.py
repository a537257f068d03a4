"""Feeds that are opened for a test, and the frames that come of them."""

from __future__ import annotations

import time
from contextlib import contextmanager

from helpers.video_clips import number_in
from ssiam.web.feeds.feed import open_feed

SOON = 10.0


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
