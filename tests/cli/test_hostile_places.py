"""Commands where the system refuses something: one line, and no endless wait."""

import os
import subprocess
import sys
import threading

import pytest

from helpers.video_clips import write_clip
from ssiam.cli import main
from ssiam.runtime.files import cache_folder
from ssiam.runtime.openvino import load_with_shared_weights
from ssiam.trackers.lite import SHIPPED
from ssiam.trackers.weight_imports import copy_files

FULL = "/dev/full"


def _run(arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "ssiam", *arguments], stderr=subprocess.PIPE, text=True, **options
    )


@pytest.mark.skipif(not os.path.exists(FULL), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["--version"], ["weights", "list"], ["track", "--help"]])
def test_a_full_standard_output_is_one_line(arguments):
    with open(FULL, "w") as full:
        done = _run(arguments, stdout=full)
    assert done.returncode == 2
    assert done.stderr == "ssiam: standard output: cannot be written (No space left on device)\n"


def test_without_a_home_folder_there_is_no_cache(monkeypatch):
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(os, "getuid", lambda: 2**31 - 5)  # no entry in the password file
    assert not cache_folder().exists()
    with pytest.raises(OSError, match="Not a directory"):
        cache_folder().mkdir(parents=True)


@pytest.mark.parametrize(
    "source", ["file://[x", "file:///%00x", "file://", "http://[x", "rtsp://[::1"]
)
def test_addresses_that_cannot_be_parsed(capsys, source):
    assert main(["track", source, "--box", "1,2,3,4"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("threads", ["100000", "65536", str(10**30)])
def test_too_many_threads(tmp_path, capsys, threads):
    clip = write_clip(tmp_path / "a.mp4", 3)
    assert main(["track", str(clip), "--box", "1,2,30,30", "--threads", threads]) == 2
    assert f"threads is {threads}: give at most" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_without_a_reader_is_one_line(tmp_path, capsys, monkeypatch):
    clip, pipe = write_clip(tmp_path / "a.mp4", 3), tmp_path / "r.csv"
    os.mkfifo(pipe)
    track = ["track", str(clip), "--box", "1,2,30,30", "--tracker", "kcf", "--results", str(pipe)]
    monkeypatch.setattr("ssiam.outputs._READER_TIMEOUT", 0.05)
    assert main(track) == 2
    assert "cannot be written (no program reads this pipe)" in capsys.readouterr().err
    monkeypatch.setattr("ssiam.outputs._READER_TIMEOUT", 30.0)
    texts = []
    reader = threading.Thread(target=lambda: texts.append(pipe.read_text()))
    reader.start()
    assert main(track) == 0
    reader.join(30)
    assert texts[0].count("\n") == 4


def _copied(folder):
    copy_files([SHIPPED / "network.json"], folder / "weights")


def _compiled(folder):
    pytest.importorskip("onnx")
    from helpers.onnx_networks import small_network

    files = [folder.parents[2] / name for name in ("template.onnx", "search.onnx")]
    for file in files:
        file.write_bytes(small_network())
    load_with_shared_weights(files, "0" * 32)
    assert any((folder / "openvino").iterdir())


@pytest.mark.parametrize("make", [_copied, _compiled], ids=["weights", "compiled networks"])
def test_folders_in_a_shared_one_are_their_owners(tmp_path, monkeypatch, make):
    """In /tmp others could have written into them."""
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o1777)
    monkeypatch.setenv("XDG_CACHE_HOME", str(shared / "cache"))
    previous = os.umask(0)
    try:
        make(shared / "cache" / "ssiam")
    finally:
        os.umask(previous)
    assert (shared / "cache").stat().st_mode & 0o777 == 0o700
