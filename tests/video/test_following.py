"""`with_following`: frames paired with the next one."""

import pytest

from helpers.video_clips import cut, write_clip
from ssiam.errors import StreamError
from ssiam.video import open_source, with_following


def test_frames_are_paired_with_the_next(tmp_path):
    path = write_clip(tmp_path / "clip.mp4")
    with open_source(path) as source:
        pairs = list(with_following(source))
    assert [frame.index for frame, _ in pairs] == list(range(source.length))
    assert all(pairs[i][1] is pairs[i + 1][0] for i in range(len(pairs) - 1))
    assert pairs[-1][1] is None


def test_last_frame_is_delivered_before_an_error(tmp_path):
    path = cut(write_clip(tmp_path / "clip.avi", codec="mpeg4"), 0.5)
    with open_source(path) as source, pytest.raises(StreamError) as plain:
        list(source)
    delivered = []
    with open_source(path) as source:
        pairs = with_following(source)
        with pytest.raises(StreamError) as paired:
            delivered.extend((frame.index, after and after.index) for frame, after in pairs)
    count = int(str(plain.value).split("broke off after ")[1].split()[0])
    assert str(paired.value) == str(plain.value)
    assert delivered == [*((i, i + 1) for i in range(count - 1)), (count - 1, None)]


def test_no_frames():
    assert list(with_following([])) == []
