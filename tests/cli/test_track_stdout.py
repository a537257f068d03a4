"""`ssiam track --results -` and `-q`: standard output, its reader, and silence."""

import json
import os
import pty
import subprocess
import sys

import pytest

from helpers.tracked_clip import BOX, COUNT, box_of, decoded, run
from ssiam.cli import main
from ssiam.video.results import COLUMNS

KCF = ("--tracker", "kcf")


def command(*words):
    return [sys.executable, "-m", "ssiam", "track", *map(str, words), *KCF]


def test_json_lines_and_nothing_else_on_standard_output(clip, tmp_path):
    done = run("track", clip[0], "--box", box_of(BOX), "--results", "-", *KCF, cwd=tmp_path)
    assert done.returncode == 0
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [row["frame"] for row in rows] == list(range(COUNT))
    assert all(tuple(row) == COLUMNS for row in rows)
    assert f"tracked {COUNT} frames" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_with_a_progress_bar_on_a_terminal(clip, tmp_path):
    controller, terminal = pty.openpty()
    words = command(clip[0], "--box", box_of(BOX), "--results", "-")
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=terminal)
    os.close(terminal)
    output, _ = process.communicate(timeout=120)
    shown = b""
    while chunk := read_terminal(controller):
        shown += chunk
    os.close(controller)
    assert b"tracking" in shown
    assert [json.loads(line)["frame"] for line in output.splitlines()] == list(range(COUNT))


def read_terminal(controller):
    try:
        return os.read(controller, 4096)
    except OSError:  # the last process has closed it
        return b""


def test_a_row_arrives_while_the_source_is_still_open(clip, tmp_path):
    frames, _ = decoded(clip[0])
    words = command("-", "--raw", "320x240,bgr24,25", "--box", box_of(BOX), "--results", "-")
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with process:
        for frame in frames[:12]:
            process.stdin.write(frame.to_ndarray(format="bgr24").tobytes())
        process.stdin.flush()
        assert json.loads(process.stdout.readline())["frame"] == 0
        process.stdin.close()
        assert len(process.stdout.readlines()) == 11
    assert process.returncode == 0


@pytest.mark.parametrize("video", [(), ("--out", "o.mp4")], ids=["rows", "rows and video"])
def test_a_reader_that_leaves_ends_the_run_without_an_error(clip, tmp_path, video):
    words = command(clip[0], "--box", box_of(BOX), "--results", "-", *video)
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    process.stdout.readline()
    process.stdout.close()
    errors = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=120) == 0
    assert "rror" not in errors
    assert "ssiam:" not in errors
    assert [path.name for path in tmp_path.iterdir()] == (["o.mp4"] if video else [])
    if video:
        assert 1 <= len(decoded(tmp_path / "o.mp4")[0]) <= COUNT


def test_a_full_device_is_an_error(clip):
    with open("/dev/full", "w") as full:
        words = command(clip[0], "--box", box_of(BOX), "--results", "-")
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120)
    assert done.returncode == 2
    assert "cannot be written (No space left on device)" in done.stderr.splitlines()[-1]


def test_quiet_prints_nothing(clip, tmp_path):
    (tmp_path / "clip-tracked.part.mp4").touch()
    done = run("track", clip[0], "--box", box_of(BOX), "-q", *KCF, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "clip-tracked-2.mp4").exists()
    done = run("track", clip[0], "--box", box_of(BOX), "-q", "--results", "-", *KCF, cwd=tmp_path)
    assert (len(done.stdout.splitlines()), done.stderr) == (COUNT, "")


def test_quiet_prints_errors(clip, capsys):
    assert main(["track", str(clip[0]), "--box", "999,5,9,9", "--quiet"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--layout", "mot"), "'mot'"),
        (("--out", "-"), "-: unknown kind of video"),
    ],
)
def test_what_standard_output_cannot_hold(clip, capsys, arguments, named):
    words = [str(clip[0]), "--box", box_of(BOX), "--results", "-", *arguments]
    assert main(["track", *words]) == 2
    assert named in capsys.readouterr().err


def test_output_that_is_also_standard_output_is_refused(clip, tmp_path):
    words = command(clip[0], "--box", box_of(BOX), "--results", "-", "--out", "o.mp4")
    with (tmp_path / "o.mp4").open("w") as file:
        done = subprocess.run(
            [*words, "--overwrite"], stdout=file, stderr=subprocess.PIPE, text=True, cwd=tmp_path
        )
    assert done.returncode == 2
    assert "same file" in done.stderr
