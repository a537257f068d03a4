"""Damaged, unreadable and missing sources: delivered frames and error messages."""

from __future__ import annotations

import re

import av
import numpy as np
import pytest

from helpers.video_clips import number_in, read_all, write_clip
from ssiam.errors import FrameSizeError, SourceError
from ssiam.video import open_source


def test_damaged_packet_does_not_end_the_stream(tmp_path):
    path = write_clip(tmp_path / "scratched.mkv", 60, codec="mpeg4")
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 40] = bytes(range(40))
    path.write_bytes(data)
    with open_source(path) as source:
        numbers = [number_in(frame.image) for frame in source]
    assert len(numbers) >= 58
    assert numbers[-1] == 59


def test_frame_size_error_names_frame_and_sizes(tmp_path):
    small = write_clip(tmp_path / "a.ts", 10)
    large = write_clip(tmp_path / "b.ts", 10, size=(320, 192))
    joined = tmp_path / "joined.ts"
    joined.write_bytes(small.read_bytes() + large.read_bytes())
    with open_source(joined) as source:
        numbers, error = read_all(source)
        assert next(source, None) is None
    assert numbers == list(range(10))
    assert isinstance(error, FrameSizeError)
    assert re.search(r"joined\.ts: frame 10 .*320x192.*160x96", str(error))


def _audio_only(path):
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=48000, layout="mono")
        for index in range(20):
            silence = np.zeros((1, 1024), np.float32)
            frame = av.AudioFrame.from_ndarray(silence, format="fltp", layout="mono")
            frame.sample_rate, frame.pts = 48000, index * 1024
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


UNREADABLE = [
    # name of the case, file, function that writes it, words of the message
    ("missing", "missing.mp4", lambda path: None, "no such file"),
    ("empty", "empty.mp4", lambda path: path.write_bytes(b""), "empty"),
    ("text as mp4", "notes.mp4", lambda path: path.write_text("a note\n" * 99), "is it a video"),
    ("text", "notes.txt", lambda path: path.write_text("a note\n" * 99), "video"),
    ("no index", "lost.mp4", lambda path: write_clip(path) and _halve(path), "truncated"),
    ("only sound", "song.m4a", _audio_only, "only sound"),
    ("empty folder", "folder", lambda path: path.mkdir(), "holds no images"),
    ("number", "7777", lambda path: None, "no such file"),
]


def _halve(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.parametrize(
    ("name", "make", "words"), [u[1:] for u in UNREADABLE], ids=[u[0] for u in UNREADABLE]
)
def test_unreadable_file_error_is_one_line(tmp_path, name, make, words):
    path = tmp_path / name
    make(path)
    with pytest.raises(SourceError) as caught:
        open_source(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert words in message
    assert "\n" not in message


def test_missing_camera_error_names_it(tmp_path):
    for spec in ("99", 99, -1, "/dev/video99"):
        with pytest.raises(SourceError, match=r"^camera -?\d+: there is no such camera"):
            open_source(spec)
