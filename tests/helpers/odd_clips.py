"""Clips with sound, odd pixels, a display matrix, two streams, no times, or damaged frames."""

from __future__ import annotations

import struct
from fractions import Fraction

import av
import cv2
import numpy as np

from helpers.video_clips import numbered_image, write_clip
from ssiam.video import VideoSink

SAMPLES = 48000  # of sound, per second


def write_anamorphic(path, aspect):
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuv420p"
        stream.codec_context.sample_aspect_ratio = aspect
        for number in range(3):
            frame = av.VideoFrame.from_ndarray(numbered_image(number), format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def displayed_aspect(path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        return Fraction(stream.width, stream.height) * (stream.sample_aspect_ratio or 1)


def write_two_streams(path):
    """Write a small preview stream before the main stream, as some cameras do."""
    with av.open(str(path), "w") as container:
        streams = []
        for width, height in ((128, 32), (320, 192)):
            stream = container.add_stream("libx264", rate=25)
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            streams.append(stream)
        for number in range(5):
            for shift, stream in enumerate(streams):
                image = numbered_image(number + 100 * shift, stream.width, stream.height)
                frame = av.VideoFrame.from_ndarray(image, format="bgr24")
                container.mux(stream.encode(frame))
        for stream in streams:
            container.mux(stream.encode())
    return path


def write_clip_with_sound(path, codec="aac", *, count=50, rate=25, begins=0.0):
    """Write `count` frames and a tone of the same duration that grows louder."""
    layout, kind = "mono", {"aac": "fltp", "libopus": "flt"}.get(codec, "s16")
    with av.open(str(path), "w") as container:
        video = container.add_stream("libx264", rate=rate, options={"bf": "0"})
        video.width, video.height, video.pix_fmt = 160, 96, "yuv420p"
        sound = container.add_stream(codec, rate=SAMPLES, layout=layout)
        resampler = av.AudioResampler(kind, layout, SAMPLES)
        total = round(count / rate * SAMPLES)
        seconds = np.arange(total) / SAMPLES
        tone = (8000 * seconds * np.sin(2 * np.pi * 440 * seconds)).astype(np.int16)
        for number in range(count):
            frame = av.VideoFrame.from_ndarray(numbered_image(number), format="bgr24")
            frame.pts, frame.time_base = number, Fraction(1, rate)
            container.mux(video.encode(frame))
            part = tone[number * SAMPLES // rate : (number + 1) * SAMPLES // rate]
            chunk = av.AudioFrame.from_ndarray(part[None], format="s16", layout=layout)
            chunk.sample_rate = SAMPLES
            chunk.pts = number * SAMPLES // rate + round(begins * SAMPLES)
            chunk.time_base = Fraction(1, SAMPLES)
            for each in resampler.resample(chunk):
                container.mux(sound.encode(each))
        container.mux(sound.encode())
        container.mux(video.encode())
    return path


def write_undecodable(path, indices, codec="mjpeg"):
    """Write a clip in which the packets with these indices cannot be decoded."""
    write_clip(path, 40, codec=codec, codec_options={"g": "1"} if codec == "libx264" else None)
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    data = bytearray(path.read_bytes())
    for index in indices:
        start, size = packets[index].pos, packets[index].size
        data[start : start + size] = bytes(size)
    path.write_bytes(data)
    return path


def set_display_matrix(path, matrix):
    data = bytearray(path.read_bytes())
    a, b, c, d = (value << 16 for value in matrix)
    struct.pack_into(">9i", data, data.index(b"tkhd") + 44, a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data)


def write_without_times(path):
    """Four equal frames as a sequence of JPEG images, which has no timestamps."""
    with av.open(path, "w", format="mjpeg") as container:
        stream = container.add_stream("mjpeg", rate=10)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuvj420p"
        noise = np.random.default_rng(1).integers(0, 255, (96, 160, 3)).astype(np.uint8)
        for _ in range(4):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(noise, format="bgr24")))
        container.mux(stream.encode())


def write_at_times(path, seconds):
    """A soft texture that moves one pixel a frame, shown at these times."""
    noise = np.random.default_rng(1).integers(0, 255, (96, 160, 3)).astype(np.uint8)
    image = cv2.GaussianBlur(noise, (9, 9), 2)
    with VideoSink(path, 25) as sink:
        for number, second in enumerate(seconds):
            sink.write(np.roll(image, number, axis=1), second)
