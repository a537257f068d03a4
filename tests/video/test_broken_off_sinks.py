"""Files that play, whatever happens to the program that writes them."""

from __future__ import annotations

import json
import signal
import subprocess

import pytest
from clips import decoded, number_in, picture, python

from ssiam.video import VideoSink


def _write_and_raise(path, error):
    with VideoSink(path, 25) as sink:
        for number in range(33):
            sink.write(picture(number))
        raise error("while tracking")


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_exception_leaves_a_complete_file(tmp_path, error):
    with pytest.raises(error, match="while tracking"):
        _write_and_raise(tmp_path / "out.mp4", error)
    assert len(decoded(tmp_path / "out.mp4")) == 33


_WRITE_ON = """
import sys
from clips import picture
from ssiam.video import VideoSink
with VideoSink(sys.argv[1], 10) as sink:
    for number in range(10**6):
        sink.write(picture(number % 256))
        print(number, flush=True)
"""


@pytest.mark.parametrize("name", ["out.mp4", "out.mov", "out.mkv", "out.avi"])
def test_killed_writer_leaves_a_file_that_plays(tmp_path, name):
    process = python(_WRITE_ON, str(tmp_path / name), stdout=subprocess.PIPE)
    written = 0
    for line in process.stdout:
        written = int(line) + 1
        if written == 95:
            process.send_signal(signal.SIGKILL)
            break
    process.stdout.close()
    assert process.wait() == -signal.SIGKILL
    numbers = [number_in(f.to_ndarray(format="bgr24")) for f in decoded(tmp_path / name)]
    assert numbers == list(range(len(numbers)))
    # At most the last piece of a second, and what the encoder held, are lost.
    assert len(numbers) >= written - 25


def test_interrupted_writer_leaves_every_frame(tmp_path):
    process = python(
        _WRITE_ON, str(tmp_path / "out.mp4"), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    for line in process.stdout:
        if int(line) == 30:
            process.send_signal(signal.SIGINT)
            break
    rest = process.stdout.read().split()
    process.wait()
    written = int(rest[-1]) + 1 if rest else 31
    assert len(decoded(tmp_path / "out.mp4")) in (written, written + 1)


_DISK_FULL = """
import json, resource, signal, sys
from clips import picture
from ssiam.errors import SinkError
from ssiam.video import VideoSink
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
try:
    with VideoSink(sys.argv[1], 25) as sink:
        for number in range(600):
            sink.write(picture(number % 256, 320, 192))
except SinkError as error:
    print(json.dumps(str(error)))
"""


@pytest.mark.parametrize("name", ["out.mp4", "out.mkv", "out.avi"])
def test_full_disk_is_a_sink_error(tmp_path, name):
    process = python(_DISK_FULL, str(tmp_path / name), stdout=subprocess.PIPE)
    told = json.loads(process.communicate()[0])
    assert process.returncode == 0
    assert told.startswith(f"{tmp_path / name}: cannot be written")
