"""Frames that a browser pushes."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from helpers.opened_feeds import TIMEOUT
from helpers.video_clips import number_in, numbered_image
from ssiam.errors import ArgumentError
from ssiam.web.feeds.opening import open_feed
from ssiam.web.feeds.pushed import PushedFeed


def test_pushed_frames():
    feed = open_feed("browser", notify=lambda note: None)
    assert isinstance(feed, PushedFeed)
    properties = feed.name, feed.size_wh, feed.fps, feed.length, feed.seekable, feed.state
    assert properties == ("browser", None, None, None, False, "playing")
    assert feed.take(0) is None
    for number in range(4):
        feed.push(numbered_image(number))
        time.sleep(0.01)
    assert feed.dropped == 3
    assert 0 < feed.fps <= 100
    arrival = feed.take(0)
    assert number_in(arrival.frame.image) == arrival.frame.index == 3
    assert 0.03 <= arrival.frame.time <= arrival.arrived
    feed.push(numbered_image(4, 320, 192))
    assert feed.size_wh == (320, 192)
    assert feed.take(0).frame.image.shape == (192, 320, 3)
    feed.close()
    feed.push(numbered_image(5))
    assert feed.take(0) is None


def test_a_push_wakes_a_waiting_consumer():
    feed = PushedFeed()
    pusher = threading.Timer(0.05, feed.push, [numbered_image(9)])
    pusher.start()
    assert feed.take(TIMEOUT).frame.index == 0
    feed.close()


@pytest.mark.parametrize("image", [np.zeros((4, 4), np.uint8), np.zeros((0, 4, 3), np.uint8), None])
def test_an_invalid_image_is_refused(image):
    with pytest.raises(ArgumentError):
        PushedFeed().push(image)
