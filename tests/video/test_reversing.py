"""Frames in reverse order: the same frames, whatever the file; with limited memory."""

from __future__ import annotations

import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from helpers.odd_clips import set_display_matrix, write_undecodable
from helpers.video_clips import numbered_image, write_clip
from ssiam.errors import SourceError
from ssiam.video import RawFormat, VideoSink, open_source
from ssiam.video.reversing import FrameRecord, ReversedFrames, check_reversible

COUNT = 40
CHUNK = 7 * 160 * 96 * 3  # bytes of seven frames


def reversed_frames(path, first=0, last=None, **options):
    """The frames as they are read forward, and in reverse."""
    with open_source(path, **options) as frames:
        forward = [frame for frame in frames if last is None or frame.index <= last]
        info = frames.info
    records = [FrameRecord.of(frame) for frame in forward[first:]]
    reader = ReversedFrames(str(path), records, first, info, chunk_bytes=CHUNK, **options)
    return forward[first:], list(reader)


def assert_reversed(path, **options):
    forward, backward = reversed_frames(path, **options)
    assert [frame.index for frame in backward] == [frame.index for frame in forward][::-1]
    assert [frame.time for frame in backward] == [frame.time for frame in forward][::-1]
    for ahead, back in zip(forward[::-1], backward, strict=True):
        assert np.array_equal(ahead.image, back.image)
    return len(backward)


def write_variable(path):
    with VideoSink(path, 25) as sink:
        for number in range(COUNT):
            sink.write(numbered_image(number), number / 25 + (number > 20) * 1.3)


def write_folder(path):
    path.mkdir()
    for number in range(12):
        cv2.imwrite(str(path / f"{number}.png"), numbered_image(number))


def write_bare(path):
    with av.open(str(path), "w", format="h264") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuv420p"
        for number in range(COUNT):
            frame = av.VideoFrame.from_ndarray(numbered_image(number), format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def write_deep(path):
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "gray16le"
        for number in range(20):
            gray = numbered_image(number)[..., 0].astype(np.uint16) * 37 + 7000
            frame = av.VideoFrame.from_ndarray(gray, format="gray16le")
            frame.pts, frame.time_base = number, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


@pytest.mark.parametrize("name", ["c.mp4", "c.mkv", "c.mov", "c.avi", "c.ts"])
@pytest.mark.parametrize("distance", ["1", "9", "250"])
def test_containers_and_distances_of_key_frames(tmp_path, name, distance):
    options = {"g": distance, "bf": "2", "x264-params": "open-gop=1"}
    write_clip(tmp_path / name, COUNT, codec="libx264", codec_options=options)
    assert assert_reversed(tmp_path / name) == COUNT


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("variable.mp4", write_variable),
        ("variable.mkv", write_variable),
        ("folder", write_folder),
        ("bare.h264", write_bare),
        ("deep.mkv", write_deep),
    ],
)
def test_other_sources(tmp_path, name, write):
    write(tmp_path / name)
    assert assert_reversed(tmp_path / name) >= 12


def test_damaged_frames_are_left_out_in_both_directions(tmp_path):
    write_undecodable(tmp_path / "c.mov", (10, 11, 25))
    assert assert_reversed(tmp_path / "c.mov") == 37


def test_rotated_frames(tmp_path):
    write_clip(tmp_path / "c.mp4", COUNT)
    set_display_matrix(tmp_path / "c.mp4", (0, 1, -1, 0))
    assert assert_reversed(tmp_path / "c.mp4") == COUNT


def test_raw_frames(tmp_path):
    (tmp_path / "raw").write_bytes(b"".join(numbered_image(n).tobytes() for n in range(20)))
    assert assert_reversed(tmp_path / "raw", raw=RawFormat((160, 96))) == 20


@pytest.mark.parametrize(("first", "last"), [(0, 0), (3, 3), (5, 21), (20, 39)])
def test_parts(tmp_path, first, last):
    write_clip(tmp_path / "c.mp4", COUNT)
    forward, backward = reversed_frames(tmp_path / "c.mp4", first, last)
    assert [frame.index for frame in backward] == list(range(last, first - 1, -1))
    assert np.array_equal(backward[-1].image, forward[0].image)


def test_a_file_that_gets_shorter(tmp_path):
    write_clip(tmp_path / "c.mp4", COUNT)
    write_clip(tmp_path / "short.mp4", 10)
    with open_source(tmp_path / "c.mp4") as frames:
        records = [FrameRecord.of(frame) for frame in frames]
    shutil.copyfile(tmp_path / "short.mp4", tmp_path / "c.mp4")
    with pytest.raises(SourceError, match="fewer frames than before"):
        list(ReversedFrames(str(tmp_path / "c.mp4"), records, 0, frames.info))


@pytest.mark.parametrize("spec", ["-", "0", "rtsp://host/cam", "missing.mp4", "", "/dev/null"])
def test_what_cannot_be_read_from_its_end(spec):
    with pytest.raises(SourceError, match="save it to a file"):
        check_reversible(spec)


MEASURE = """
import resource, sys
from ssiam.video import open_source
from ssiam.video.reversing import FrameRecord, ReversedFrames
with open_source(sys.argv[1]) as frames:
    records = [FrameRecord.of(frame) for frame in frames]
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
reader = ReversedFrames(sys.argv[1], records, 0, frames.info, chunk_bytes=16 << 20)
assert sum(1 for _ in reader) == len(records)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_memory_does_not_grow_with_the_number_of_frames(tmp_path):
    path = Path(tmp_path / "long.mp4")
    image = cv2.resize(numbered_image(1), (640, 384))
    with VideoSink(path, 25) as sink:
        for number in range(300):  # 211 MiB
            sink.write(np.roll(image, number, axis=1))
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, str(path)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 80 << 10  # KiB


@pytest.mark.parametrize("name", ["c.mp4", "c.mkv", "c.mov", "c.avi"])
def test_files_with_an_index_are_not_decoded_from_the_beginning(tmp_path, monkeypatch, name):
    write_clip(tmp_path / name, COUNT, codec="libx264", codec_options={"g": "9", "bf": "2"})
    monkeypatch.setattr(ReversedFrames, "_from_beginning", None)
    assert assert_reversed(tmp_path / name) == COUNT
