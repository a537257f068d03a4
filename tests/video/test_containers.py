"""Container metadata: orientation, pixel aspect, several video streams, sound."""

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
    displayed_aspect,
    set_display_matrix,
    write_anamorphic,
    write_clip_with_sound,
    write_two_streams,
)
from helpers.video_clips import decoded, number_in, numbered_image, write_clip
from ssiam.errors import SourceError
from ssiam.video import VideoSink, open_source

ORIENTATIONS = [
    # matrix a, b, c, d of the track header; its effect on an image
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
def test_orientation_matches_ffmpeg(tmp_path, flags):
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
def test_pixel_aspect_is_copied(tmp_path, name):
    given = write_anamorphic(tmp_path / "dv.mp4", Fraction(16, 15))
    with open_source(given) as source:
        aspect = source.info.pixel_aspect
        assert aspect == Fraction(16, 15)
        with VideoSink(tmp_path / name, source.fps, pixel_aspect=aspect) as sink:
            for frame in source:
                sink.write(frame.image, frame.time)
    assert displayed_aspect(tmp_path / name) == displayed_aspect(given)


def test_pixel_aspect_of_rotated_video_is_inverted(tmp_path):
    path = write_anamorphic(tmp_path / "rotated.mp4", Fraction(4, 3))
    set_display_matrix(path, (0, 1, -1, 0))
    with open_source(path) as source:
        assert source.size_wh == (96, 160)
        assert source.info.pixel_aspect == Fraction(3, 4)


@pytest.mark.parametrize("name", ["two.mp4", "two.mkv", "two.ts"])
def test_default_stream_has_most_pixels(tmp_path, name):
    path = write_two_streams(tmp_path / name)
    for stream, size_wh, first in (
        (None, (320, 192), 100),
        (0, (128, 32), 0),
        (1, (320, 192), 100),
    ):
        with open_source(path, stream=stream) as source:
            assert source.size_wh == size_wh
            assert [number_in(frame.image) for frame in source] == list(range(first, first + 5))


def test_missing_stream_is_refused(tmp_path):
    path = write_two_streams(tmp_path / "two.mkv")
    for stream in (2, -1):
        with pytest.raises(
            SourceError, match=rf"no video stream {stream}: .*0 \(128x32\), 1 \(320"
        ):
            open_source(path, stream=stream)
    (tmp_path / "folder").mkdir()
    cv2.imwrite(str(tmp_path / "folder" / "1.png"), numbered_image(1))
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
    path = write_clip_with_sound(tmp_path / given, codec)
    sink = _copied(path, tmp_path / out)
    assert sink.sound_omitted is None
    before, after = _packets(path), _packets(tmp_path / out)
    assert float(after[-1][0]) == pytest.approx(1.97, abs=0.06)
    if given == "a.ts":  # its packets repeat headers that other containers store once
        assert len(before) * 0.9 < len(after) <= len(before)
    else:
        assert b"".join(data for _, data in after) in b"".join(data for _, data in before)
    assert len(decoded(tmp_path / out)) == 50


def test_sound_is_cut_to_written_frames(tmp_path):
    path = write_clip_with_sound(tmp_path / "a.mp4", count=100)
    _copied(path, tmp_path / "o.mp4", frames=25)
    with av.open(str(tmp_path / "o.mp4")) as container:
        video, sound = container.streams.video[0], container.streams.audio[0]
        assert float(video.duration * video.time_base) == pytest.approx(1.0, abs=0.01)
        assert float(sound.duration * sound.time_base) == pytest.approx(1.0, abs=0.05)


def test_sound_is_aligned_when_first_frames_are_skipped(tmp_path):
    """The tone grows louder with time, so its amplitude identifies the position in the source."""
    path = write_clip_with_sound(tmp_path / "a.mkv", "pcm_s16le", count=100)
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


def test_offset_between_sound_and_frames_is_kept(tmp_path):
    path = write_clip_with_sound(tmp_path / "a.mkv", "pcm_s16le", begins=0.5)
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
def test_unsupported_sound_is_reported(tmp_path, given, codec, out, words):
    sink = _copied(write_clip_with_sound(tmp_path / given, codec), tmp_path / out)
    assert words in sink.sound_omitted
    assert _packets(tmp_path / out) == []
    numbers = [number_in(f.to_ndarray(format="bgr24")) for f in decoded(tmp_path / out)]
    assert numbers == list(range(50))


def test_frames_without_times_discard_sound(tmp_path):
    path = write_clip_with_sound(tmp_path / "a.mkv", "pcm_s16le")
    with (
        open_source(path, sound=True) as source,
        VideoSink(tmp_path / "o.mkv", 25, sound=source.info.sound) as sink,
    ):
        for frame in source:
            sink.write(frame.image)
    assert "no timestamps" in sink.sound_omitted
    assert source.info.sound.next_before(1e9) is None


def test_source_without_sound_is_not_reported(tmp_path):
    sink = _copied(write_clip(tmp_path / "a.mp4", 5), tmp_path / "o.mp4")
    assert sink.sound_omitted is None


@pytest.mark.parametrize("out", ["o.mp4", "o.mkv"])
def test_damaged_sound_does_not_stop_the_video(tmp_path, out):
    path = write_clip_with_sound(tmp_path / "a.ts", "aac")
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
