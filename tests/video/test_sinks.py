"""`VideoSink`: written frames can be read back, and unwritable outputs are refused."""

from __future__ import annotations

import os

import av
import cv2
import numpy as np
import pytest

from helpers.video_clips import NTSC, decoded, number_in, numbered_image
from ssiam.errors import FrameSizeError, SinkError
from ssiam.video import VideoSink, open_source

NAMES = ["out.mp4", "out.mkv", "out.avi", "out.mov", "OUT.MP4"]


@pytest.mark.parametrize("name", NAMES)
def test_written_frames_are_read_back(tmp_path, name):
    path = tmp_path / name
    with VideoSink(path, NTSC) as sink:
        for number in range(40):
            sink.write(numbered_image(number))
    frames = decoded(path)
    assert [number_in(f.to_ndarray(format="bgr24")) for f in frames] == list(range(40))
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.average_rate == NTSC
        assert stream.codec_context.name == "h264"
        assert stream.pix_fmt == "yuv420p"
        assert container.duration / av.time_base == pytest.approx(40 / NTSC, abs=0.002)


def test_mp4_is_not_fragmented_after_closing(tmp_path):
    path = tmp_path / "out.mp4"
    with VideoSink(path, 25) as sink:
        for number in range(60):
            sink.write(numbered_image(number))
    # A finished file is a plain mp4: its index counts every frame, and it has no fragments.
    with av.open(str(path)) as container:
        assert container.streams.video[0].frames == 60
    boxes = _boxes(path.read_bytes())
    assert boxes[0] == b"ftyp"
    assert boxes.count(b"moov") == 1
    assert b"moof" not in boxes


def _boxes(data):
    kinds, start = [], 0
    while start < len(data):
        size = int.from_bytes(data[start : start + 4], "big")
        if size == 1:
            size = int.from_bytes(data[start + 8 : start + 16], "big")
        kinds.append(data[start + 4 : start + 8])
        start += size
    return kinds


def test_opencv_reads_the_file(tmp_path):
    with VideoSink(tmp_path / "out.mp4", 30) as sink:
        for number in range(10):
            sink.write(numbered_image(number))
    capture = cv2.VideoCapture(str(tmp_path / "out.mp4"))
    assert [number_in(capture.read()[1]) for _ in range(10)] == list(range(10))


@pytest.mark.parametrize("name", ["out.mp4", "out.mkv"])
def test_variable_times_are_kept(tmp_path, name):
    seconds = [100.0, 100.04, 100.08, 100.5, 100.52, 101.7, 101.8]
    with VideoSink(tmp_path / name, 25) as sink:
        for number, second in enumerate(seconds):
            sink.write(numbered_image(number), second)
    times = [frame.time for frame in decoded(tmp_path / name)]
    assert times == pytest.approx([second - 100 for second in seconds], abs=0.0006)


def test_ntsc_rate_is_kept_exactly(tmp_path):
    with VideoSink(tmp_path / "a.mp4", NTSC) as sink:
        for number in range(90):
            sink.write(numbered_image(number))
    with open_source(tmp_path / "a.mp4") as source, VideoSink(tmp_path / "b.mp4", NTSC) as sink:
        for frame in source:
            sink.write(frame.image, frame.time)
    times = [frame.pts * frame.time_base for frame in decoded(tmp_path / "b.mp4")]
    assert times == [index / NTSC for index in range(90)]


@pytest.mark.parametrize("size", [(160, 96), (161, 96), (160, 97), (163, 99)])
def test_odd_sizes_are_padded_to_even_ones(tmp_path, size):
    image = np.full((size[1], size[0], 3), (40, 60, 220), np.uint8)
    with VideoSink(tmp_path / "out.mp4", 25, size_wh=size) as sink:
        sink.write(image)
    got = decoded(tmp_path / "out.mp4")[0].to_ndarray(format="bgr24")
    assert got.shape == (size[1] + size[1] % 2, size[0] + size[0] % 2, 3)
    assert got.reshape(-1, 3).min(axis=0) == pytest.approx((40, 60, 220), abs=6)
    assert got.reshape(-1, 3).max(axis=0) == pytest.approx((40, 60, 220), abs=6)


def test_input_is_not_modified_and_may_be_a_view(tmp_path):
    image = numbered_image(3, 320, 192)
    before = image.copy()
    with VideoSink(tmp_path / "out.mp4", 25) as sink:
        sink.write(image[::2, ::2])
    assert np.array_equal(image, before)
    assert decoded(tmp_path / "out.mp4")[0].width == 160


UNWRITABLE = [
    # name of the case, path, words of the message
    ("no folder", "none/out.mp4", "there is no folder"),
    ("a folder", "folder.mp4", "is a folder"),
    ("file as folder", "file.txt/out.mp4", "there is no folder"),
    ("unknown kind", "out.gif", "unknown kind"),
    ("no kind", "out", "unknown kind"),
]


@pytest.mark.parametrize(
    ("name", "words"), [u[1:] for u in UNWRITABLE], ids=[u[0] for u in UNWRITABLE]
)
def test_unwritable_path_is_refused_on_construction(tmp_path, name, words):
    (tmp_path / "folder.mp4").mkdir()
    (tmp_path / "file.txt").write_text("")
    with pytest.raises(SinkError, match=words) as caught:
        VideoSink(tmp_path / name, 25)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_write_protected_folder_is_refused_on_construction(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(SinkError, match="cannot be written"):
        VideoSink(tmp_path / "out.mp4", 25)


def test_sink_without_frames_leaves_no_file(tmp_path):
    with VideoSink(tmp_path / "out.mp4", 25):
        pass
    assert list(tmp_path.iterdir()) == []


def test_other_frame_size_is_refused(tmp_path):
    with VideoSink(tmp_path / "out.mp4", 25) as sink:
        sink.write(numbered_image(0))
        with pytest.raises(FrameSizeError, match=r"320x96 .*160x96"):
            sink.write(numbered_image(0, 320, 96))


@pytest.mark.parametrize("rate", [0, -1, float("nan"), float("inf")])
def test_invalid_rate_is_refused(tmp_path, rate):
    with pytest.raises(ValueError, match="frame rate"):
        VideoSink(tmp_path / "out.mp4", rate)
