"""Restarts of files: in the middle, after the end, after they broke off."""

from __future__ import annotations

import pytest

from helpers.opened_feeds import TIMEOUT, indices, numbers, opened, rest
from helpers.video_clips import cut, number_in, write_clip
from ssiam.errors import SourceError


@pytest.mark.parametrize("when", ["in the middle", "after the end", "while paused"])
@pytest.mark.parametrize("pace", ["clock", "fast"])
def test_restart(clip, pace, when):
    with opened(clip, pace=pace) as (feed, notes):
        feed.take(TIMEOUT)
        if when == "after the end":
            rest(feed)
            assert feed.state == "ended"
        feed.pause(when == "while paused")
        before = feed.dropped
        feed.restart()
        assert feed.state == "playing"
        first = feed.take(TIMEOUT)
        # All earlier frames of this run were dropped.
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


@pytest.mark.parametrize("index", [0, 1, 17, 29])
def test_restart_at_a_frame(clip, index):
    with opened(clip, pace="fast") as (feed, _):
        feed.take(TIMEOUT)
        feed.restart(index)
        assert numbers(rest(feed)) == list(range(index, 30))
        feed.restart(1000)
        assert rest(feed) == []
        assert feed.state == "ended"


def test_restart_of_a_deleted_file(clip, tmp_path):
    path = tmp_path / "gone.mp4"
    path.write_bytes(clip.read_bytes())
    with opened(path, pace="fast") as (feed, _):
        feed.take(TIMEOUT)
        path.unlink()
        with pytest.raises(SourceError, match=r"gone\.mp4: no such file"):
            feed.restart()
        assert indices(rest(feed)) == list(range(1, 30))


def _without_b_frames(path):
    """A clip without B-frames."""
    return write_clip(path, 60, codec_options={"bf": "0"})


def _joined(path):
    small = write_clip(path / "a.ts", 10)
    large = write_clip(path / "b.ts", 10, size=(320, 192))
    joined = path / "joined.ts"
    joined.write_bytes(small.read_bytes() + large.read_bytes())
    return joined


BROKEN = [
    ("cut file", lambda path: cut(_without_b_frames(path / "clip.mkv"), 0.5), "broke off after"),
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
        assert feed.take(TIMEOUT).frame.index == 0
