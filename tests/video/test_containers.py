"""What containers tell beside the pixels: orientation, pixel aspect, several streams, sound."""

from __future__ import annotations

import subprocess
from fractions import Fraction
from itertools import islice

import av
import cv2
import numpy as np
import pytest

from helpers.odd_clips import (
    SAMPLES,
    anamorphic,
    displayed_aspect,
    set_display_matrix,
    with_preview,
    with_sound,
)
from helpers.video_clips import decoded, number_in, picture, write_clip
from ssiam.errors import SourceError
from ssiam.video import VideoSink, open_source

ORIENTATIONS = [
    # matrix a, b, c, d of the track header; what it does to an image
    ((1, 0, 0, 1), lambda image: image),
    ((-1, 0, 0, 1), lambda image: image[:, ::-1]),
    ((1, 0, 0, -1), lambda image: image[::-1]),
    ((-1, 0, 0, -1), lambda image: image[::-1, ::-1]),
    ((0, 1, 1, 0), lambda image: image.swapaxes(0, 1)),
    ((0, 1, -1, 0), lambda image: np.rot90(image, -1)),
    ((0, -1, 1, 0), lambda image: np.rot90(image)),
    ((0, -1, -1, 0), lambda image: np.rot90(image.swapaxes(0, 1), 2)),
]


@pytest.mark.parametrize(
    ("matrix", "expected"), ORIENTATIONS, ids=[str(each[0]) for each in ORIENTATIONS]
)
def test_every_display_matrix_is_applied(tmp_path, matrix, expected):
    path = write_clip(tmp_path / "phone.mp4", 2)
    with open_source(path) as source:
        stored = next(source).image
    set_display_matrix(path, matrix)
    with open_source(path) as source:
        assert np.array_equal(next(source).image, expected(stored))


FLAGS = [
    *([], ["-display_hflip"], ["-display_vflip"], ["-display_rotation", "90"]),
    *(["-display_rotation", "90", flip] for flip in ("-display_hflip", "-display_vflip")),
    *(["-display_rotation", turn] for turn in ("180", "270")),
]


@pytest.mark.parametrize("flags", FLAGS, ids=" ".join)
def test_frames_are_as_ffmpeg_shows_them(tmp_path, flags):
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    plain = write_clip(tmp_path / "plain.mp4", 3)
    video, image = str(tmp_path / "video.mp4"), str(tmp_path / "image.png")
    command = [ffmpeg, "-v", "error", *flags, "-i", str(plain), "-c", "copy", video]
    subprocess.run(command, check=True)
    subprocess.run([ffmpeg, "-v", "error", "-i", video, "-frames:v", "1", image], check=True)
    expected = cv2.imread(image).astype(int)
    with open_source(video) as source:
        got = next(source).image
    assert got.shape == expected.shape
    assert np.abs(got - expected).mean() < 2


@pytest.mark.parametrize("name", ["out.mp4", "out.mov", "out.mkv", "out.avi"])
def test_video_displays_as_its_source(tmp_path, name):
    given = anamorphic(tmp_path / "dv.mp4", Fraction(16, 15))
    with open_source(given) as source:
        aspect = source.info.pixel_aspect
        assert aspect == Fraction(16, 15)
        with VideoSink(tmp_path / name, source.fps, pixel_aspect=aspect) as sink:
            for frame in source:
                sink.write(frame.image, frame.time)
    assert displayed_aspect(tmp_path / name) == displayed_aspect(given)


def test_pixels_of_turned_videos_are_turned(tmp_path):
    path = anamorphic(tmp_path / "turned.mp4", Fraction(4, 3))
    set_display_matrix(path, (0, 1, -1, 0))
    with open_source(path) as source:
        assert source.size_wh == (96, 160)
        assert source.info.pixel_aspect == Fraction(3, 4)


@pytest.mark.parametrize("name", ["two.mp4", "two.mkv", "two.ts"])
def test_largest_stream_unless_another_is_asked_for(tmp_path, name):
    path = with_preview(tmp_path / name)
    for stream, size_wh, first in (
        (None, (320, 192), 100),
        (0, (128, 32), 0),
        (1, (320, 192), 100),
    ):
        with open_source(path, stream=stream) as source:
            assert source.size_wh == size_wh
            assert [number_in(frame.image) for frame in source] == list(range(first, first + 5))


def test_streams_that_are_not_there(tmp_path):
    path = with_preview(tmp_path / "two.mkv")
    for stream in (2, -1):
        with pytest.raises(
            SourceError, match=rf"no video stream {stream}: .*0 \(128x32\), 1 \(320"
        ):
            open_source(path, stream=stream)
    (tmp_path / "folder").mkdir()
    cv2.imwrite(str(tmp_path / "folder" / "1.png"), picture(1))
    for spec in (tmp_path / "folder", 99):
        with pytest.raises(SourceError, match="no video streams to choose from"):
            open_source(spec, stream=0)


def _copied(path, out, frames=None):
    with (
        open_source(path, sound=True) as source,
        VideoSink(out, source.fps, sound=source.info.sound) as sink,
    ):
        for frame in islice(source, frames):
            sink.write(frame.image, frame.time)
    return sink


def _packets(path):
    with av.open(str(path)) as container:
        if not container.streams.audio:
            return []
        return [(p.pts * p.time_base, bytes(p)) for p in container.demux(audio=0) if p.size]


@pytest.mark.parametrize(
    ("given", "codec", "out"),
    [
        ("a.mp4", "aac", "o.mp4"),
        ("a.mkv", "libopus", "o.mp4"),
        ("a.mkv", "libopus", "o.mkv"),
        ("a.avi", "pcm_s16le", "o.avi"),
        ("a.avi", "pcm_s16le", "o.mov"),
        ("a.mov", "aac", "o.avi"),
        ("a.ts", "aac", "o.mp4"),
        ("a.ts", "mp2", "o.mkv"),
    ],
)
def test_sound_is_copied(tmp_path, given, codec, out):
    path = with_sound(tmp_path / given, codec)
    sink = _copied(path, tmp_path / out)
    assert sink.silence is None
    before, after = _packets(path), _packets(tmp_path / out)
    assert float(after[-1][0]) == pytest.approx(1.97, abs=0.06)
    if given == "a.ts":  # whose packets carry headers that other containers have once
        assert len(before) * 0.9 < len(after) <= len(before)
    else:
        assert b"".join(data for _, data in after) in b"".join(data for _, data in before)
    assert len(decoded(tmp_path / out)) == 50


def test_sound_is_cut_to_the_frames_written(tmp_path):
    path = with_sound(tmp_path / "a.mp4", count=100)
    _copied(path, tmp_path / "o.mp4", frames=25)
    with av.open(str(tmp_path / "o.mp4")) as container:
        video, sound = container.streams.video[0], container.streams.audio[0]
        assert float(video.duration * video.time_base) == pytest.approx(1.0, abs=0.01)
        assert float(sound.duration * sound.time_base) == pytest.approx(1.0, abs=0.05)


def test_sound_stays_with_its_frames_where_they_begin_later(tmp_path):
    """Loudness tells the time: frames from the second second on have the sound of then."""
    path = with_sound(tmp_path / "a.mkv", "pcm_s16le", count=100)
    with (
        open_source(path, sound=True) as source,
        VideoSink(tmp_path / "o.mkv", source.fps, sound=source.info.sound) as sink,
    ):
        for frame in islice(source, 50, None):
            sink.write(frame.image, frame.time)
    with av.open(str(tmp_path / "o.mkv")) as container:
        samples = np.concatenate([f.to_ndarray()[0] for f in container.decode(audio=0)])
    assert len(samples) / SAMPLES == pytest.approx(2.0, abs=0.05)
    assert np.abs(samples[: SAMPLES // 10]).max() == pytest.approx(8000 * 2.1, rel=0.05)


def test_sound_that_begins_before_the_frames_is_cut(tmp_path):
    path = with_sound(tmp_path / "a.mkv", "pcm_s16le", begins=0.5)
    _copied(path, tmp_path / "o.mkv")
    assert _packets(tmp_path / "o.mkv")[0][0] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("given", "codec", "out", "words"),
    [
        ("a.mkv", "libopus", "o.mov", "cannot hold opus"),
        ("a.mkv", "libopus", "o.avi", "cannot hold opus"),
        ("a.ts", "aac", "o.avi", "cannot hold aac"),
    ],
)
def test_sound_that_cannot_be_held_is_told(tmp_path, given, codec, out, words):
    sink = _copied(with_sound(tmp_path / given, codec), tmp_path / out)
    assert words in sink.silence
    assert _packets(tmp_path / out) == []
    numbers = [number_in(f.to_ndarray(format="bgr24")) for f in decoded(tmp_path / out)]
    assert numbers == list(range(50))


def test_frames_without_times_have_no_sound_and_keep_none(tmp_path):
    path = with_sound(tmp_path / "a.mkv", "pcm_s16le")
    with (
        open_source(path, sound=True) as source,
        VideoSink(tmp_path / "o.mkv", 25, sound=source.info.sound) as sink,
    ):
        for frame in source:
            sink.write(frame.image)
    assert "no times" in sink.silence
    assert source.info.sound.next_before(1e9) is None


def test_without_sound_nothing_is_said(tmp_path):
    sink = _copied(write_clip(tmp_path / "a.mp4", 5), tmp_path / "o.mp4")
    assert sink.silence is None


@pytest.mark.parametrize("out", ["o.mp4", "o.mkv"])
def test_damaged_sound_does_not_end_the_video(tmp_path, out):
    path = with_sound(tmp_path / "a.ts", "aac")
    with av.open(str(path)) as container:
        index = container.streams.audio[0].id
    data = bytearray(path.read_bytes())
    for start in range(188 * 40, len(data) - 188, 188):
        identifier = (data[start + 1] & 0x1F) << 8 | data[start + 2]
        if identifier == index and not data[start + 1] & 0x40:
            data[start + 4 : start + 188] = bytes(range(184))
    path.write_bytes(data)
    _copied(path, tmp_path / out)
    assert len(decoded(tmp_path / out)) == 50
