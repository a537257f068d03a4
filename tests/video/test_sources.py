"""Video files: decoded frames, times, orientation and memory use."""

from __future__ import annotations

import struct
from fractions import Fraction

import av
import numpy as np
import pytest

from helpers.odd_clips import set_display_matrix
from helpers.video_clips import NTSC, decoded, number_in, numbered_image, python, shared, write_clip
from ssiam.video import open_source

WHOLE_FILES = [
    # name, codec, options of the container
    ("plain.mp4", "libx264", {}),
    ("faststart.mp4", "libx264", {"movflags": "faststart"}),
    ("fragmented.mp4", "libx264", {"movflags": "frag_keyframe+empty_moov"}),
    ("clip.mov", "mjpeg", {}),
    ("clip.mkv", "libx264", {}),
    ("live.mkv", "libx264", {"live": "1"}),
    ("clip.webm", "libvpx", {}),
    ("clip.avi", "mpeg4", {}),
    ("mjpeg.avi", "mjpeg", {}),
    ("clip.ts", "libx264", {}),
    ("clip.flv", "libx264", {}),
    ("clip.mpg", "mpeg2video", {}),
]


@pytest.mark.parametrize(("name", "codec", "options"), WHOLE_FILES, ids=lambda v: str(v)[:20])
def test_all_frames_in_order_with_exact_rate(tmp_path, name, codec, options):
    path = write_clip(tmp_path / name, 40, codec=codec, options=options)
    with open_source(path) as source:
        assert source.fps == NTSC
        assert source.size_wh == (160, 96)
        frames = list(source)
    assert [number_in(frame.image) for frame in frames] == list(range(40))
    assert [frame.index for frame in frames] == list(range(40))
    times = [frame.time for frame in frames]
    assert times == pytest.approx([float(i / NTSC) for i in range(40)], abs=0.0011)


def test_length_is_announced_count(tmp_path):
    for name in ("a.mp4", "a.avi", "a.mkv"):
        codec = "mpeg4" if name.endswith("avi") else "libx264"
        with open_source(write_clip(tmp_path / name, 25, codec=codec)) as source:
            assert source.length == 25


@pytest.mark.parametrize("name", ["vfr.mp4", "vfr.mkv"])
def test_variable_frame_rate_keeps_its_times(tmp_path, name):
    seconds = [0, 0.04, 0.08, 0.5, 0.52, 1.7, 1.8, 2.9, 2.94, 3.0]
    path = write_clip(tmp_path / name, 10, rate=Fraction(25), seconds=seconds)
    with open_source(path) as source:
        assert [frame.time for frame in source] == pytest.approx(seconds, abs=0.0011)
        # Ten frames in three seconds; Matroska announces the rate set in the encoder.
        assert 2.5 < source.fps < 4 or (name == "vfr.mkv" and source.fps == 25)


def test_times_count_from_the_first_frame(tmp_path):
    path = write_clip(tmp_path / "late.mkv", 5, seconds=[7.0, 7.1, 7.2, 7.3, 7.4])
    with open_source(path) as source:
        assert [frame.time for frame in source] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])


ROTATIONS = [
    # display matrix of the track header, new (row, column) of the stored top left corner
    ("upright", (1, 0, 0, 1), (96, 160), (0, 0)),
    ("quarter turn clockwise", (0, 1, -1, 0), (160, 96), (0, -1)),
    ("upside down", (-1, 0, 0, -1), (96, 160), (-1, -1)),
    ("quarter turn counter-clockwise", (0, -1, 1, 0), (160, 96), (-1, 0)),
]


@pytest.mark.parametrize(
    ("matrix", "shape", "corner"), [r[1:] for r in ROTATIONS], ids=[r[0] for r in ROTATIONS]
)
def test_rotation_of_phone_videos_is_applied(tmp_path, matrix, shape, corner):
    path = tmp_path / "phone.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuv420p"
        image = np.zeros((96, 160, 3), np.uint8)
        image[:32, :32] = 255
        container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    set_display_matrix(path, matrix)
    with open_source(path) as source:
        upright = next(source).image
    assert upright.shape[:2] == shape
    assert source.size_wh == shape[::-1]
    bright = [c for c in ((0, 0), (0, -1), (-1, 0), (-1, -1)) if upright[c].mean() > 127]
    assert bright == [corner]


def test_file_trimmed_by_edit_list_is_complete(tmp_path):
    path = write_clip(tmp_path / "trimmed.mp4", 60, codec_options={"bf": "0"})
    data = bytearray(path.read_bytes())
    # The edit list plays one of the two seconds in the file.
    (ticks_per_second,) = struct.unpack_from(">I", data, data.index(b"mvhd") + 16)
    struct.pack_into(">I", data, data.index(b"elst") + 12, ticks_per_second)
    path.write_bytes(data)
    with open_source(path) as source:
        assert [number_in(frame.image) for frame in source] == list(range(30))


def test_colors_are_kept(tmp_path):
    path = tmp_path / "hd.mp4"
    color = (40, 60, 220)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"crf": "1"})
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuv420p"
        stream.codec_context.colorspace = 1
        image = np.full((96, 160, 3), color, np.uint8)
        frame = av.VideoFrame.from_ndarray(image, format="bgr24")
        container.mux(stream.encode(frame.reformat(format="yuv420p", dst_colorspace="ITU709")))
        container.mux(stream.encode())
    with open_source(path) as source:
        assert next(source).image[48, 80] == pytest.approx(color, abs=4)


@pytest.mark.parametrize("name", ["a:b.mp4", "50%d.mp4", "gr\u00f6\u00dfe \u5f71.mp4", "#?.mp4"])
def test_special_characters_in_file_names(tmp_path, name):
    path = tmp_path / name
    write_clip(tmp_path / "plain.mp4", 3).rename(path)
    with open_source(str(path)) as source:
        assert len(list(source)) == 3
    with open_source(path.as_uri()) as source:
        assert len(list(source)) == 3


def test_closed_source_has_no_more_frames(tmp_path):
    source = open_source(write_clip(tmp_path / "a.mp4", 10))
    next(source)
    source.close()
    source.close()
    assert next(source, None) is None


_PEAK = """
import resource, sys
from ssiam.video import open_source
with open_source(sys.argv[1]) as source:
    for frame in source:
        pass
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
"""


def test_memory_use_is_independent_of_length(tmp_path):
    peaks = []
    for count in (30, 300):
        path = write_clip(
            tmp_path / f"{count}.mp4", count, size=(640, 360), codec_options={"preset": "ultrafast"}
        )
        process = python(_PEAK, str(path), stdout=-1)
        peaks.append(int(process.communicate()[0]))
    # 270 additional frames are 178 MB of pixels.
    assert peaks[1] - peaks[0] < 15


@pytest.mark.parametrize(
    ("name", "count"), [("handheld.mp4", 133), ("shaky-5.avi", 496)], ids=["handheld", "shaky"]
)
def test_real_clips_are_read_completely(name, count):
    path = shared("data", "videos", name)
    with open_source(path) as source:
        frames = sum(1 for _ in source)
    assert frames == count == len(decoded(path))


def test_helpers_write_and_read_numbers():
    assert [number_in(numbered_image(n)) for n in (0, 1, 77, 255)] == [0, 1, 77, 255]
