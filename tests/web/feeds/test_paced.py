"""Frames are delivered in real time or on demand; late ones are dropped."""

from __future__ import annotations

import time
from fractions import Fraction

import cv2
import pytest

from helpers.feed_servers import file_server
from helpers.opened_feeds import TIMEOUT, indices, numbers, opened, rest, wait_for
from helpers.video_clips import number_in, numbered_image, write_clip


def _folder(path):
    path.mkdir()
    for number in range(30):
        cv2.imwrite(str(path / f"{number}.png"), numbered_image(number))
    return path


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_on_demand_every_frame_is_delivered(tmp_path, clip, kind):
    spec = clip if kind == "file" else _folder(tmp_path / "folder")
    with opened(spec, pace="fast") as (feed, notes):
        assert (feed.name, feed.size_wh, feed.length) == (str(spec), (160, 96), 30)
        assert feed.fps == (50 if kind == "file" else 30)
        assert feed.seekable
        arrivals = rest(feed)
        assert numbers(arrivals) == indices(arrivals) == list(range(30))
        assert (feed.dropped, feed.state, feed.take(0), notes) == (0, "ended", None, [])


def test_in_real_time_no_frame_is_early(tmp_path):
    seconds = [0, 0.02, 0.04, 0.2, 0.22, 0.5]
    spec = write_clip(tmp_path / "vfr.mp4", 6, rate=Fraction(50), seconds=seconds)
    began = time.monotonic()
    with opened(spec) as (feed, _):
        arrivals = rest(feed)
    for arrival in arrivals:
        assert arrival.arrived >= began + arrival.frame.time
    assert arrivals[-1].frame.index == 5


def test_a_slow_consumer_gets_the_newest_frame_and_the_rest_is_counted(clip):
    with opened(clip) as (feed, _):
        first = feed.take(TIMEOUT)
        wait_for(lambda: feed.dropped >= 5)
        second = feed.take(TIMEOUT)
        assert second.frame.index - first.frame.index > 5
        assert number_in(second.frame.image) == second.frame.index
        taken = [first, second, *rest(feed)]
        assert len(taken) + feed.dropped == 30
        assert taken[-1].frame.index == 29


def test_the_last_frame_is_kept_until_it_is_taken(clip):
    with opened(clip) as (feed, _):
        wait_for(lambda: feed.dropped == 29)
        assert feed.state == "playing"
        assert feed.take(TIMEOUT).frame.index == 29
        wait_for(lambda: feed.state == "ended")


def test_segments_of_a_playlist_play_in_real_time(tmp_path):
    playlist = write_clip(
        tmp_path / "live.m3u8",
        30,
        rate=Fraction(50),
        options={"hls_time": "0.2", "hls_list_size": "0"},
        codec_options={"g": "10"},
    )
    # Without its last line, the playlist is that of a live stream.
    playlist.write_text(playlist.read_text().replace("#EXT-X-ENDLIST\n", ""))
    began = time.monotonic()
    with file_server(tmp_path) as address, opened(f"{address}/live.m3u8") as (feed, _):
        arrivals = [feed.take(TIMEOUT) for _ in range(8)]
        for arrival in arrivals:
            assert arrival.arrived >= began + arrival.frame.time
        assert feed.length is None
