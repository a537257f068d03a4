"""Written videos stay playable after exceptions, kills, interrupts and full disks."""

from __future__ import annotations

import json
import signal
import subprocess

import pytest

from helpers.video_clips import decoded, number_in, numbered_image, python, read_all
from ssiam.errors import SinkError
from ssiam.video import VideoSink, open_source


def _write_and_raise(path, error):
    with VideoSink(path, 25) as sink:
        for number in range(33):
            sink.write(numbered_image(number))
        raise error("failed while tracking")


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_exception_leaves_complete_file(tmp_path, error):
    with pytest.raises(error, match="failed while tracking"):
        _write_and_raise(tmp_path / "out.mp4", error)
    assert len(decoded(tmp_path / "out.mp4")) == 33


_WRITE_FOREVER = """
import sys
from helpers.video_clips import numbered_image
from ssiam.video import VideoSink
with VideoSink(sys.argv[1], 10) as sink:
    for number in range(10**6):
        sink.write(numbered_image(number % 256))
        print(number, flush=True)
"""


@pytest.mark.parametrize("name", ["out.mp4", "out.mov", "out.mkv", "out.avi"])
def test_killed_writer_leaves_playable_part(tmp_path, name):
    process = python(_WRITE_FOREVER, str(tmp_path / name), stdout=subprocess.PIPE)
    written = 0
    for line in process.stdout:
        written = int(line) + 1
        if written == 95:
            process.send_signal(signal.SIGKILL)
            break
    process.stdout.close()
    assert process.wait() == -signal.SIGKILL
    stem, _, suffix = name.partition(".")
    assert [path.name for path in tmp_path.iterdir()] == [f"{stem}.part.{suffix}"]
    part = decoded(tmp_path / f"{stem}.part.{suffix}")
    numbers = [number_in(f.to_ndarray(format="bgr24")) for f in part]
    assert numbers == list(range(len(numbers)))
    # Only the frames held by the encoder are lost.
    assert len(numbers) >= written - 8


def test_part_is_playable_after_few_frames(tmp_path):
    process = python(_WRITE_FOREVER, str(tmp_path / "out.mp4"), stdout=subprocess.PIPE)
    for line in process.stdout:
        if int(line) == 9:
            process.send_signal(signal.SIGKILL)
            break
    process.stdout.close()
    process.wait()
    assert len(decoded(tmp_path / "out.part.mp4")) >= 2


def test_new_part_does_not_replace_old_parts(tmp_path):
    (tmp_path / "out.part.mp4").write_text("left")
    (tmp_path / "out.part-2.mp4").write_text("left too")
    with VideoSink(tmp_path / "out.mp4", 25) as sink:
        sink.write(numbered_image(0))
        assert sink.location == tmp_path / "out.part-3.mp4"
    assert sink.location == tmp_path / "out.mp4"
    assert len(decoded(tmp_path / "out.mp4")) == 1
    assert (tmp_path / "out.part.mp4").read_text() == "left"
    assert (tmp_path / "out.part-2.mp4").read_text() == "left too"
    assert not (tmp_path / "out.part-3.mp4").exists()


def test_file_created_while_writing_is_not_replaced(tmp_path):
    sink = VideoSink(tmp_path / "out.mp4", 25, overwrite=False)
    sink.write(numbered_image(0))
    (tmp_path / "out.mp4").write_text("written by another program")
    with pytest.raises(SinkError, match=r"out\.mp4: cannot be written .*is in .*out\.part\.mp4"):
        sink.close()
    sink.close()
    assert (tmp_path / "out.mp4").read_text() == "written by another program"
    assert len(decoded(tmp_path / "out.part.mp4")) == 1


def test_interrupted_writer_keeps_all_frames(tmp_path):
    process = python(
        _WRITE_FOREVER, str(tmp_path / "out.mp4"), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
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
from helpers.video_clips import numbered_image
from ssiam.errors import SinkError
from ssiam.video import VideoSink
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
try:
    with VideoSink(sys.argv[1], 25) as sink:
        for number in range(600):
            sink.write(numbered_image(number % 256, 320, 192))
except SinkError as error:
    print(json.dumps(str(error)))
"""


@pytest.mark.parametrize("name", ["out.mp4", "out.mkv", "out.avi"])
def test_full_disk_raises_sink_error_and_keeps_part_and_existing_file(tmp_path, name):
    (tmp_path / name).write_text("older")
    process = python(_DISK_FULL, str(tmp_path / name), stdout=subprocess.PIPE)
    message = json.loads(process.communicate()[0])
    assert process.returncode == 0
    part = (tmp_path / name).with_suffix(f".part{(tmp_path / name).suffix}")
    assert message.startswith(f"{tmp_path / name}: cannot be written")
    assert message.endswith(f"; what was written is in {part}")
    assert (tmp_path / name).read_text() == "older"
    numbers, _ = read_all(open_source(part))
    assert len(numbers) > 50
