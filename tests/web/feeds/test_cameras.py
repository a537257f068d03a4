"""Cameras are read during pauses, and reconnected after they were lost."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from helpers.feed_servers import JpegCamera
from helpers.opened_feeds import TIMEOUT, indices, opened, wait_for
from helpers.video_clips import number_in
from ssiam.errors import SourceError
from ssiam.video.sources import open_capture
from ssiam.web.feeds.reconnecting import ReconnectingFeed
from ssiam.web.types import CommandError


def test_a_camera_is_read_while_paused_and_delivers_its_newest_frame():
    camera = JpegCamera()
    with camera.on_air() as address, opened(address) as (feed, _):
        assert (feed.length, feed.seekable, feed.size_wh) == (None, False, (160, 96))
        feed.take(TIMEOUT)
        feed.pause(True)
        dropped, sent = feed.dropped, camera.sent
        wait_for(lambda: camera.sent > sent + 30)
        assert feed.take(0) is None
        # The feed notices after it has read all that was sent.
        camera.hang_up()
        wait_for(lambda: feed.state == "reconnecting")
        feed.advance()
        stepped = feed.take(TIMEOUT)
        assert stepped.frame.index == number_in(stepped.frame.image) == camera.sent - 1
        assert feed.take(0.03) is None
        assert feed.dropped == dropped
        camera.come_back()
        feed.pause(False)
        assert feed.take(TIMEOUT).frame.index > stepped.frame.index
        with pytest.raises(CommandError, match="cannot be restarted") as caught:
            feed.restart()
        assert caught.value.code == "not-possible"


def test_a_camera_that_hangs_up_is_reconnected():
    camera = JpegCamera()
    with camera.on_air() as address, opened(address) as (feed, notes):
        arrivals = [feed.take(TIMEOUT) for _ in range(5)]
        for size in ((160, 96), (320, 192)):
            camera.hang_up()
            wait_for(lambda: feed.state == "reconnecting")
            camera.come_back(size)
            wait_for(lambda: feed.state == "playing")
            arrivals += [feed.take(TIMEOUT) for _ in range(5)]
            assert feed.size_wh == size == arrivals[-1].frame.image.shape[1::-1]
        assert indices(arrivals) == sorted(set(indices(arrivals)))
        times = [arrival.frame.time for arrival in arrivals]
        assert all(step > 0 for step in np.diff(times))
        # The times include the gaps.
        assert times[-1] > 0.5
        name = address.split("?")[0].replace("anna:hunter2@", "")
        assert [(note.level, note.message) for note in notes] == [
            ("warning", f"{name}: connection lost; trying to reconnect"),
            ("info", f"{name}: reconnected"),
            ("warning", f"{name}: connection lost; trying to reconnect"),
            ("warning", f"{name}: reconnected, now with 320x192 pixels"),
        ]


def test_close_while_reconnecting():
    camera = JpegCamera()
    with camera.on_air() as address, opened(address) as (feed, notes):
        feed.take(TIMEOUT)
        camera.hang_up()
        wait_for(lambda: feed.state == "reconnecting")
        feed.close()
        feed.close()
        assert len(notes) == 1


def test_a_camera_that_was_unplugged_is_opened_again(clip):
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
    assert feed.take(TIMEOUT).frame.index == 59
    feed.close()
    assert [note.level for note in notes] == ["warning", "info", "warning"]
