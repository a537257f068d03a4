"""Frame times: from the stream, from arrival, or unknown, and frame rates."""

from __future__ import annotations

import http.server
import io
import subprocess
import threading
import time
from contextlib import contextmanager
from fractions import Fraction
from itertools import pairwise

import av
import cv2
import numpy as np
import pytest

from helpers.video_clips import decoded, number_in, numbered_image, python, write_clip
from ssiam.video import VideoSink, open_source

JITTERED = [0.0, 0.04, 0.065, 0.097, 0.131, 0.166, 0.204, 0.234, 0.27, 0.299]
SLOWER = [*(0.04 * i for i in range(10)), *(0.36 + 0.16 * i for i in range(1, 6)), 1.2, 1.24]


def _jpeg(number):
    return cv2.imencode(".jpg", numbered_image(number), [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


@contextmanager
def _camera(count, gap, *, lengths=True):
    """An MJPEG camera over HTTP that sends `count` images, `gap` seconds apart."""

    class Camera(http.server.BaseHTTPRequestHandler):
        def log_message(self, *args):
            pass

        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace;boundary=part")
            self.end_headers()
            for number in range(count):
                jpeg = _jpeg(number)
                length = b"Content-Length: %d\r\n" % len(jpeg) if lengths else b""
                head = b"--part\r\nContent-Type: image/jpeg\r\n" + length + b"\r\n"
                self.wfile.write(head + jpeg + b"\r\n")
                time.sleep(gap)

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Camera) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@pytest.mark.parametrize("lengths", [True, False])
def test_mjpeg_over_http_has_times_of_arrival(lengths):
    with _camera(8, 0.25, lengths=lengths) as address, open_source(address) as source:
        assert not source.info.is_rate_known
        assert source.info.is_variable
        times = []
        with pytest.raises(Exception, match="broke off"):
            times.extend(frame.time for frame in source)
    # FFmpeg would count them 0.04 s apart; a busy machine makes them later, not earlier.
    assert len(times) >= 7
    assert times[0] == 0
    assert times[6] > 6 * 0.25 - 0.1


def test_times_of_arrival_are_independent_of_the_reader():
    with _camera(8, 0.1) as address, open_source(address) as source:
        first = next(source)
        time.sleep(1.5)
        second = next(source)
    assert (first.time, number_in(second.image)) == (0, 1)
    assert second.time < 1.0


def test_closing_a_camera_ends_its_thread():
    with _camera(30, 0.05) as address:
        source = open_source(address)
        next(source)
        source.close()
        assert not [t for t in threading.enumerate() if t.name == "ssiam-arrivals"]


def test_concatenated_jpegs_have_no_times(tmp_path):
    path = write_clip(tmp_path / "clip.mjpeg", 6, codec="mjpeg", rate=Fraction(25), format="mjpeg")
    with open_source(path) as source:
        assert [frame.time for frame in source] == [None] * 6
        assert not source.info.is_rate_known
        assert source.info.notes == ["has no timestamps: assuming 25 frames per second"]


def test_piped_png_has_no_times():
    code = """
from ssiam.video import open_source
print([frame.time for frame in open_source("-")])
"""
    data = b"".join(
        cv2.imencode(".png", numbered_image(number))[1].tobytes() for number in range(4)
    )
    process = python(code, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.communicate(data)[0].strip() == b"[None, None, None, None]"


def test_bare_h264_has_announced_rate(tmp_path):
    path = write_clip(tmp_path / "clip.h264", 30, rate=Fraction(50), format="h264")
    with open_source(path) as source:
        assert source.fps == 50
        assert source.info.is_rate_known


@pytest.mark.parametrize("name", ["clip.dv", "dv.avi"])
def test_rate_of_dv(tmp_path, name):
    path = tmp_path / name
    with av.open(str(tmp_path / "clip.dv"), "w") as container:
        stream = container.add_stream("dvvideo", rate=25)
        stream.width, stream.height, stream.pix_fmt = 720, 576, "yuv420p"
        for number in range(12):
            frame = av.VideoFrame.from_ndarray(numbered_image(number, 720, 576), format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    if name != "clip.dv":
        _remux(tmp_path / "clip.dv", path)
    with open_source(path) as source:
        assert source.fps == 25
        times = [frame.time for frame in source]
    assert times == pytest.approx([i / 25 for i in range(12)], abs=0.001)


def _remux(source, target):
    with av.open(str(source)) as given, av.open(str(target), "w") as container:
        stream = container.add_stream_from_template(given.streams.video[0])
        for packet in given.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                container.mux_one(packet)


@pytest.mark.parametrize("name", ["clip.ts", "clip.asf"])
def test_clock_ticks_are_not_taken_as_rate(tmp_path, name):
    """FFmpeg reports 2000 and 1000 frames per second for these."""
    seconds = [time + 0.036 * (i // 10) * 10 for i, time in enumerate(JITTERED * 4)]
    path = write_clip(tmp_path / name, 40, seconds=seconds, codec_options={"bf": "0"})
    with open_source(path) as source:
        assert 20 < source.fps < 45
        assert source.info.is_variable
        assert [frame.time for frame in source] == pytest.approx(seconds, abs=0.002)


@pytest.mark.parametrize("name", ["clip.avi", "clip.asf"])
def test_b_frames_with_decoding_times_only(tmp_path, name):
    path = write_clip(tmp_path / name, 40, rate=Fraction(25), codec_options={"bf": "2"})
    with open_source(path) as source:
        frames = list(source)
    assert [number_in(frame.image) for frame in frames] == list(range(40))
    times = [frame.time for frame in frames]
    assert times == pytest.approx([i / 25 for i in range(40)], abs=0.001)


@pytest.mark.parametrize("seconds", [JITTERED, SLOWER], ids=["jittered", "slower"])
def test_avi_keeps_times_of_variable_rate(tmp_path, seconds):
    path = tmp_path / "out.avi"
    rate = Fraction((len(seconds) - 1) / seconds[-1]).limit_denominator(1001)
    with VideoSink(path, rate, is_variable=True) as sink:
        for number, second in enumerate(seconds):
            sink.write(numbered_image(number), second)
    assert sink.dropped_frames == 0
    for times in (_first_times(decoded(path)), _first_times_by_count(path)):
        first = [times[number] for number in range(len(seconds))]
        assert first == pytest.approx(seconds, abs=0.006)


def _first_times(frames):
    """First display time of each number, seconds since the first frame."""
    times = {}
    for frame in frames:
        number = number_in(frame.to_ndarray(format="bgr24"))
        times.setdefault(number, frame.time - frames[0].time)
    return times


def _first_times_by_count(path):
    """The same for readers that count frames, as with OpenCV."""
    capture = cv2.VideoCapture(str(path))
    rate, times, index = capture.get(cv2.CAP_PROP_FPS), {}, 0
    while (read := capture.read())[0]:
        times.setdefault(number_in(read[1]), index / rate)
        index += 1
    return times


def test_variable_rate_avi_without_times(tmp_path):
    path = tmp_path / "out.avi"
    with VideoSink(path, 25, is_variable=True) as sink:
        assert [sink.write(numbered_image(number)) for number in range(5)] == [
            0,
            0.04,
            0.08,
            0.12,
            0.16,
        ]
    with av.open(str(path)) as container:
        assert container.duration / av.time_base == pytest.approx(0.2)


def test_avi_of_constant_rate_repeats_no_frames(tmp_path):
    with VideoSink(tmp_path / "out.avi", 25) as sink:
        for number in range(30):
            sink.write(numbered_image(number), number / 25 + 0.004 * (number % 2))
    assert len(decoded(tmp_path / "out.avi")) == 30


def test_avi_drops_and_counts_frames_faster_than_its_rate(tmp_path):
    path = tmp_path / "out.avi"
    with VideoSink(path, 25) as sink:
        written = [sink.write(numbered_image(number), number / 50) for number in range(60)]
    assert sink.dropped_frames == written.count(None) > 20
    times = _first_times(decoded(path))
    assert set(times) == {number for number, time in enumerate(written) if time is not None}
    assert all(abs(time - number / 50) <= 1.01 / 25 for number, time in times.items())


def test_other_containers_drop_no_frames(tmp_path):
    for name in ("out.mp4", "out.mkv"):
        with VideoSink(tmp_path / name, 25) as sink:
            written = [sink.write(numbered_image(number), number / 50) for number in range(20)]
        assert written == pytest.approx([number / 50 for number in range(20)], abs=1e-4)
        assert all(after > before for before, after in pairwise(written))


def test_apng_keeps_its_times(tmp_path):
    seconds = [0.0, 0.1, 0.3, 0.35]
    data = io.BytesIO()
    with av.open(data, "w", format="apng") as container:
        stream = container.add_stream("apng", rate=100)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "rgb24"
        stream.codec_context.time_base = Fraction(1, 100)
        for number, second in enumerate(seconds):
            frame = av.VideoFrame.from_ndarray(numbered_image(number), format="bgr24")
            frame.pts, frame.time_base = round(100 * second), Fraction(1, 100)
            container.mux(stream.encode(frame.reformat(format="rgb24")))
        container.mux(stream.encode())
    (tmp_path / "clip.png").write_bytes(data.getvalue())
    with open_source(tmp_path / "clip.png") as source:
        frames = list(source)
    assert [frame.time for frame in frames] == pytest.approx(seconds, abs=0.011)
    assert np.array_equal(frames[2].image, numbered_image(2))
