"""Cameras: read while nobody looks, and found again when they come back."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from helpers.feed_servers import JpegCamera
from helpers.opened_feeds import SOON, indices, opened, wait_for
from helpers.video_clips import number_in
from ssiam.errors import SourceError
from ssiam.video.sources import open_capture
from ssiam.web.errors import CommandError
from ssiam.web.feeds.reconnecting import ReconnectingFeed


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
