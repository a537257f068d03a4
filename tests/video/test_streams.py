"""Standard input and network addresses, with local servers."""

from __future__ import annotations

import http.server
import json
import signal
import socketserver
import subprocess
import threading
import time
from contextlib import contextmanager
from functools import partial

import pytest

from helpers.video_clips import NTSC, numbered_image, python, read_all, write_clip, y4m
from ssiam.errors import SourceError, StreamError
from ssiam.video import open_source

_READ_STDIN = """
import json, sys
from fractions import Fraction
from helpers.video_clips import number_in
from ssiam.errors import SsiamError
from ssiam.video import RawFormat, open_source
raw = RawFormat((160, 96), sys.argv[1], Fraction(25)) if len(sys.argv) > 1 else None
result = {"numbers": [], "times": []}
try:
    with open_source("-", raw=raw) as source:
        result["fps"] = str(source.fps)
        for frame in source:
            result["numbers"].append(number_in(frame.image))
            result["times"].append(frame.time)
except SsiamError as error:
    result["error"] = f"{type(error).__name__}: {error}"
print(json.dumps(result))
"""


def _read_piped(data, *args):
    process = python(_READ_STDIN, *args, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    return json.loads(process.communicate(data)[0])


def test_y4m_from_standard_input():
    result = _read_piped(y4m(range(12)))
    assert result["numbers"] == list(range(12))
    assert result["fps"] == str(NTSC)
    assert result["times"] == pytest.approx([float(i / NTSC) for i in range(12)])
    assert "error" not in result


@pytest.mark.parametrize("name", ["clip.ts", "clip.mkv", "clip.avi"])
def test_containers_from_standard_input(tmp_path, name):
    codec = "mpeg4" if name.endswith("avi") else "libx264"
    result = _read_piped(write_clip(tmp_path / name, 20, codec=codec).read_bytes())
    assert result["numbers"] == list(range(20))
    assert result["fps"] == str(NTSC)
    assert "error" not in result


@pytest.mark.parametrize("pixel_format", ["bgr24", "rgb24"])
def test_raw_frames_from_standard_input(pixel_format):
    result = _read_piped(b"".join(numbered_image(n).tobytes() for n in range(5)), pixel_format)
    assert result["numbers"] == list(range(5))
    assert result["times"] == pytest.approx([0, 0.04, 0.08, 0.12, 0.16])
    assert "error" not in result


PIPED_ERRORS = [
    # name of the case, bytes, arguments, delivered frames, error
    ("nothing", b"", (), 0, "SourceError: standard input:"),
    ("text", b"hello\n" * 500, (), 0, "SourceError: standard input:"),
    ("y4m cut in a frame", y4m(range(6))[:-5000], (), 5, "StreamError: standard input: broke off"),
    ("raw cut", bytes(160 * 96 * 3 * 2 + 9), ("bgr24",), 2, "StreamError: standard input: broke"),
    ("no such pixel format", bytes(99999), ("bgr42",), 0, "SourceError: standard input:"),
]


@pytest.mark.parametrize(
    ("data", "args", "count", "error"),
    [case[1:] for case in PIPED_ERRORS],
    ids=[case[0] for case in PIPED_ERRORS],
)
def test_errors_on_standard_input(data, args, count, error):
    result = _read_piped(data, *args)
    assert len(result["numbers"]) == count
    assert result["error"].startswith(error)


def test_ctrl_c_while_waiting_for_data():
    code = """
from ssiam.video import open_source
try:
    with open_source("-") as source:
        for frame in source:
            print(frame.index, flush=True)
except KeyboardInterrupt:
    print("interrupted")
"""
    process = python(code, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    process.stdin.write(y4m(range(8)))
    process.stdin.flush()
    assert process.stdout.readline() == b"0\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    assert process.stdout.read().endswith(b"interrupted\n")
    assert process.wait() == 0
    process.stdin.close()


class _Handler(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


class _TruncatingHandler(_Handler):
    """Announces the whole file and disconnects after half of it."""

    def do_GET(self):
        with open(self.translate_path(self.path), "rb") as file:
            data = file.read()
        self.send_response(200)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data[: len(data) // 2])


@contextmanager
def _served(handler):
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@pytest.mark.parametrize("name", ["clip.mp4", "clip.mkv", "clip.ts"])
def test_http(tmp_path, name):
    write_clip(tmp_path / name, 20)
    server = _served(partial(_Handler, directory=tmp_path))
    with server as address, open_source(f"{address}/{name}") as source:
        assert source.name == f"{address}/{name}"
        assert source.fps == NTSC
        assert read_all(source) == (list(range(20)), None)


def test_http_server_that_disconnects(tmp_path):
    write_clip(tmp_path / "clip.mkv", 60)
    server = _served(partial(_TruncatingHandler, directory=tmp_path))
    with server as address, open_source(f"{address}/clip.mkv") as source:
        numbers, error = read_all(source)
    assert isinstance(error, StreamError)
    assert f"broke off after {len(numbers)} of 60 frames" in str(error)
    assert numbers == list(range(len(numbers)))
    assert 10 < len(numbers) < 50


def test_errors_for_addresses_contain_no_secret(tmp_path):
    with _served(partial(_Handler, directory=tmp_path)) as address:
        host = address.removeprefix("http://")
        specs = [
            f"http://anna:hunter2@{host}/none.mp4?token=hunter2",
            "rtsp://anna:hunter2@127.0.0.1:9/live?key=hunter2",
            "tcp://anna:hunter2@127.0.0.1:9",
            "nothing://anna:hunter2@127.0.0.1/",
        ]
        for spec in specs:
            with pytest.raises(SourceError) as caught:
                open_source(spec)
            assert "127.0.0.1" in str(caught.value)
            assert "hunter2" not in str(caught.value)
            assert caught.value.__suppress_context__
