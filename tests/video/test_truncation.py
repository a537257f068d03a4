"""Truncated files: the remaining frames are delivered, and then an error is raised."""

from __future__ import annotations

import random

import av
import pytest

from helpers.video_clips import cut, read_all, shared, write_clip
from ssiam.errors import SourceError, SsiamError, StreamError
from ssiam.video import RawFormat, open_source

CONTAINERS = [
    # name, codec, options of the container, announced frames
    ("faststart.mp4", "libx264", {"movflags": "faststart"}, 60),
    ("fragmented.mp4", "libx264", {"movflags": "frag_keyframe+empty_moov"}, None),
    ("clip.mov", "mjpeg", {"movflags": "faststart"}, 60),
    ("clip.mkv", "libx264", {}, 60),
    ("clip.webm", "libvpx", {}, 60),
    ("clip.avi", "mpeg4", {}, 60),
    ("mjpeg.avi", "mjpeg", {}, 60),
    ("clip.flv", "libx264", {}, None),
    ("clip.ts", "libx264", {}, None),
]


@pytest.mark.parametrize("share", [0.9, 0.5])
@pytest.mark.parametrize(
    ("name", "codec", "options", "announced"), CONTAINERS, ids=[c[0] for c in CONTAINERS]
)
def test_truncated_file_delivers_frames_then_raises(
    tmp_path, name, codec, options, announced, share
):
    whole = write_clip(tmp_path / name, codec=codec, options=options, codec_options={"g": "10"})
    path = cut(whole, share)
    with open_source(path) as source:
        numbers, error = read_all(source)
    assert isinstance(error, StreamError)
    assert f"{name}: broke off after {len(numbers)}" in str(error)
    # The damaged last frame of a transport stream is delivered, possibly out of order.
    intact = len(numbers) - 4
    assert numbers[:intact] == list(range(intact))
    assert len(numbers) == pytest.approx(_frames_before(whole, path.stat().st_size), abs=1)
    if announced:
        assert f"after {len(numbers)} of {announced} frames" in str(error)


def _frames_before(path, byte):
    """Number of frames that end before a byte offset of the file."""
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    return sum(packet.pos + packet.size <= byte for packet in packets)


def test_transport_stream_cut_at_packet_boundary_is_detected(tmp_path):
    path = write_clip(tmp_path / "clip.ts", size=(320, 192), codec_options={"crf": "10", "g": "1"})
    data = path.read_bytes()
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size][1:]
    for large in sorted(packets, key=lambda packet: packet.size)[-3:]:
        assert large.size > 188 * 4
        middle = large.pos + large.size // 2
        path.write_bytes(data[: middle // 188 * 188])
        with open_source(path) as source, pytest.raises(StreamError, match="last frame is cut"):
            list(source)


def test_missing_index_is_reported_as_truncated(tmp_path):
    path = cut(write_clip(tmp_path / "clip.mp4"), 0.9)
    with pytest.raises(SourceError, match="truncated"):
        open_source(path)


def test_file_cut_before_first_frame_is_refused(tmp_path):
    path = cut(write_clip(tmp_path / "clip.mkv"), 0.05)
    with pytest.raises(SourceError, match=r"no frame .* truncated"):
        open_source(path)


def test_raw_file_with_partial_last_frame(tmp_path):
    path = tmp_path / "frames.raw"
    path.write_bytes(bytes(160 * 96 * 3 * 4 + 1000))
    source = open_source(path, raw=RawFormat((160, 96)))
    with source, pytest.raises(StreamError, match="broke off after 4"):
        list(source)


def test_half_of_a_real_recording(tmp_path):
    data = shared("data", "videos", "shaky-5.avi").read_bytes()
    path = tmp_path / "half.avi"
    path.write_bytes(data[: len(data) // 2])
    with open_source(path) as source, pytest.raises(StreamError, match="of 496 frames"):
        list(source)


def _with_random_bytes(data, rng):
    for _ in range(rng.choice([1, 10, 200])):
        data[rng.randrange(min(len(data), rng.choice([300, 3000, 10**9])))] = rng.randrange(256)
    return data


def _with_gap(data, rng):
    start = rng.randrange(len(data))
    return data[:start] + data[start + rng.randrange(1, 4000) :]


DAMAGE = {
    "random bytes": _with_random_bytes,
    "gap": _with_gap,
    "truncated": lambda data, rng: data[: rng.randrange(len(data))],
    "headless": lambda data, rng: data[rng.randrange(len(data)) :],
    "noise": lambda data, rng: bytearray(rng.randbytes(3000)),
}


def _read(path):
    try:
        with open_source(path) as source:
            return read_all(source)[1]
    except SsiamError as error:
        return error


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_files_raise_only_ssiam_errors(tmp_path, damage):
    rng = random.Random(damage)
    clips = [write_clip(tmp_path / n, 20, codec=c) for n, c, _, _ in CONTAINERS]
    failures = 0
    for turn in range(36):
        clip = clips[turn % len(clips)]
        path = tmp_path / f"garbage{clip.suffix}"
        path.write_bytes(DAMAGE[damage](bytearray(clip.read_bytes()), rng))
        error = _read(path)
        failures += error is not None
        assert "\n" not in str(error)
    assert failures > 0
