"""Outputs of `ssiam track`, `export` and `live`: never over an input or an existing file."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import pytest

from helpers.synthetic import world
from helpers.tracked_clip import BOX, COUNT, SIZE, box_of, decoded, rows_of, run, write_clip
from ssiam.cli import main

TRACK = ("--box", box_of(BOX), "--tracker", "kcf")


@pytest.fixture
def folder(clip, tmp_path, monkeypatch):
    """The current folder with a clip under several names, its results and a folder of frames."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(clip[0], "clip.mp4")
    Path("link.mp4").symlink_to("clip.mp4")
    Path("table.csv").symlink_to("clip.mp4")
    Path("image.png").symlink_to("clip.mp4")
    os.link("clip.mp4", "hard.mp4")
    Path("dangling.mp4").symlink_to("new.csv")
    Path("frames").mkdir()
    for index in range(3):
        cv2.imwrite(f"frames/{index}.png", world(size_wh=SIZE))
    os.link("frames/1.png", "hard.csv")
    Path("weights").mkdir()
    Path("weights/backbone.onnx").write_text("onnx")
    Path("weights.csv").symlink_to("weights/backbone.onnx")
    Path("list.ffconcat").write_text("ffconcat version 1.0\nfile 'clip.mp4'\n")
    Path("master.m3u8").write_text("#EXTM3U\n#EXT-X-STREAM-INF:BANDWIDTH=1\nlist.m3u8\n")
    segment = '#EXT-X-MAP:URI="hard.mp4"\n#EXTINF:1.3,\nseg.m4s\n'
    Path("list.m3u8").write_text(f"#EXTM3U\n#EXT-X-TARGETDURATION:5\n{segment}")
    # It lists itself under a name that would grow with each reading.
    Path("cycle.m3u8").write_text("#EXTM3U\nframes/../cycle.m3u8\nhard.mp4\n")
    Path("results.csv").write_text("frame,time\n")
    Path("results.xml").symlink_to("results.csv")
    return tmp_path


def file_contents(folder):
    """Contents of all files of a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


INPUTS = [
    # name of the case, arguments, part of the message
    ("itself", ("track", "clip.mp4", *TRACK, "--out", "clip.mp4"), "--out clip.mp4"),
    ("another spelling", ("track", "clip.mp4", *TRACK, "--out", "./clip.mp4"), "--out clip.mp4"),
    ("through a folder", ("track", "clip.mp4", *TRACK, "--out", "frames/../clip.mp4"), "--out"),
    ("symbolic link", ("track", "clip.mp4", *TRACK, "--out", "link.mp4"), "--out link.mp4"),
    ("hard link", ("track", "clip.mp4", *TRACK, "--out", "hard.mp4"), "--out hard.mp4"),
    ("source is a link", ("track", "link.mp4", *TRACK, "--out", "clip.mp4"), "--out clip.mp4"),
    ("results", ("track", "clip.mp4", *TRACK, "--results", "table.csv"), "--results table.csv"),
    ("plot", ("track", "clip.mp4", *TRACK, "--plot", "image.png"), "--plot image.png"),
    ("address of a file", ("track", "FILE://clip.mp4", *TRACK, "--out", "clip.mp4"), "--out"),
    ("list", ("track", "list.ffconcat", *TRACK, "--out", "link.mp4"), "the source clip.mp4"),
    ("playlist", ("track", "master.m3u8", *TRACK, "--out", "clip.mp4"), "the source hard.mp4"),
    ("listed and missing", ("track", "list.m3u8", *TRACK, "--out", "seg.m4s"), "--out seg.m4s"),
    ("cycle", ("track", "cycle.m3u8", *TRACK, "--out", "clip.mp4"), "the source hard.mp4"),
    ("frame", ("track", "frames", *TRACK, "--plot", "frames/1.png"), "--plot frames/1.png"),
    ("hard link of a frame", ("track", "frames", *TRACK, "--results", "hard.csv"), "hard.csv"),
    ("would be a frame", ("track", "frames", *TRACK, "--plot", "frames/p.png"), "read as a frame"),
    (
        "weights",
        ("track", "clip.mp4", *TRACK, "--weights", "weights", "--results", "weights.csv"),
        "--results weights.csv is the file of --weights weights/backbone.onnx",
    ),
    (
        "two outputs",
        ("track", "clip.mp4", *TRACK, "--out", "dangling.mp4", "--results", "new.csv"),
        "--out dangling.mp4 and --results new.csv are the same file",
    ),
    (
        "export over the video",
        ("export", "results.csv", "--to", "coco", "--video", "clip.mp4", "--out", "hard.mp4"),
        "--out hard.mp4 is the file of the source clip.mp4",
    ),
    (
        "export over a frame",
        ("export", "results.csv", "--to", "coco", "--video", "frames", "--out", "frames/0.png"),
        "--out frames/0.png",
    ),
    (
        "export over the results",
        ("export", "results.csv", "--to", "cvat", "--video", "clip.mp4", "--out", "results.xml"),
        "--out results.xml is the file of results results.csv",
    ),
    ("live, Rerun", ("live", "clip.mp4", "--rerun", "hard.mp4"), "--rerun hard.mp4"),
    ("live, recordings", ("live", "frames", "--recordings", "./frames"), "--recordings frames"),
]


@pytest.mark.parametrize("overwrite", [False, True], ids=["", "overwrite"])
@pytest.mark.parametrize(
    ("arguments", "named"), [i[1:] for i in INPUTS], ids=[i[0] for i in INPUTS]
)
def test_output_that_is_an_input_is_refused(folder, arguments, named, overwrite, capsys):
    before = file_contents(folder)
    words = [a.replace("FILE://", f"file://{folder}/") for a in arguments]
    assert main([*words, *(["--overwrite"] if overwrite else [])]) == 2
    captured = capsys.readouterr()
    assert named in captured.err
    assert captured.err.startswith("ssiam: ")
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert file_contents(folder) == before


def test_redirected_standard_streams_are_checked(folder):
    before = file_contents(folder)
    command = [sys.executable, "-m", "ssiam"]
    with open("clip.mp4", "rb") as stdin:
        done = subprocess.run(
            [*command, "track", "-", *TRACK, "--out", "clip.mp4", "--overwrite"],
            stdin=stdin,
            capture_output=True,
            text=True,
            timeout=120,
        )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--out clip.mp4 is the file of the source" in done.stderr
    with open("results.csv", "ab") as stdout:
        words = ["export", "results.csv", "--to", "coco", "--size", "9x9", "--fps", "25"]
        done = subprocess.run(
            [*command, *words, "--out", "/dev/stdout"],
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
        )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--out /dev/stdout is the file of results results.csv" in done.stderr
    assert file_contents(folder) == before


@pytest.mark.parametrize(
    ("option", "name"),
    [("--out", "o.mp4"), ("--results", "o.csv"), ("--plot", "o.png"), ("--results", "o_2.txt")],
)
def test_existing_files_are_refused_without_overwrite(folder, option, name, capsys):
    Path(name).write_text("existing")
    given = "o.txt" if name == "o_2.txt" else name
    words = ["track", "clip.mp4", *TRACK, "--box", "9,9,30,30", option, given]
    assert main(words) == 2
    captured = capsys.readouterr()
    assert f"{name}: exists already" in captured.err
    assert "--overwrite" in captured.err
    assert captured.err.count("\n") == 1
    assert Path(name).read_text() == "existing"
    assert main([*words, "--overwrite"]) == 0
    assert Path(name).stat().st_size > 100
    assert not list(folder.glob("*.part*"))


def test_existing_export_is_refused_without_overwrite(folder, capsys):
    assert main(["track", "clip.mp4", *TRACK, "--results", "r.csv"]) == 0
    Path("o.json").write_text("existing")
    words = ["export", "r.csv", "--to", "coco", "--video", "clip.mp4", "--out", "o.json"]
    assert main(words) == 2
    assert "o.json: exists already" in capsys.readouterr().err
    assert Path("o.json").read_text() == "existing"
    assert main([*words, "--overwrite"]) == 0
    assert Path("o.json").read_text().startswith("{")


def test_default_names_are_numbered(folder):
    for name in ("clip-tracked", "clip-tracked-2", "clip-tracked-3"):
        before = file_contents(folder)
        assert main(["track", "clip.mp4", *TRACK]) == 0
        new = set(file_contents(folder)) - set(before)
        assert new == {folder / f"{name}.mp4", folder / f"{name}.csv"}
        assert before.items() <= file_contents(folder).items()
    # A number is skipped even if only one of its two names is taken.
    Path("clip-tracked-2.csv").unlink()
    Path("clip-tracked.mp4").unlink()
    assert main(["track", "clip.mp4", *TRACK]) == 0
    assert Path("clip-tracked-4.mp4").exists()
    assert main(["track", "clip.mp4", *TRACK, "--overwrite"]) == 0
    assert Path("clip-tracked.mp4").exists()
    assert not Path("clip-tracked-5.mp4").exists()


@pytest.mark.parametrize(
    "given", [(), ("--out", "long-tracked.mp4", "--results", "long-tracked.csv")]
)
def test_part_of_a_killed_run_plays_and_is_reported_by_the_next_run(tmp_path, given):
    write_clip(tmp_path / "long.mp4", count=300)
    command = [sys.executable, "-m", "ssiam", "track", "long.mp4", *TRACK, *given]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)
    table, video = tmp_path / "long-tracked.part.csv", tmp_path / "long-tracked.part.mp4"
    deadline = time.monotonic() + 60
    while not table.exists() or table.read_bytes().count(b"\n") < 30:
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    assert not list(tmp_path.glob("long-tracked.???"))
    left = table.read_bytes(), video.read_bytes()
    assert len(decoded(video)[0]) >= 20
    assert left[0].endswith(b"\n")

    done = run("track", "long.mp4", *TRACK, *given, cwd=tmp_path)
    assert done.returncode == 0
    assert {line.split()[1] for line in done.stderr.splitlines()} == {table.name, video.name}
    assert (table.read_bytes(), video.read_bytes()) == left
    name = "long-tracked" if given else "long-tracked-2"
    assert (
        len(decoded(tmp_path / f"{name}.mp4")[0]) == len(rows_of(tmp_path / f"{name}.csv")) == 300
    )


def _limit_file_size(limit):
    def set_limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return set_limit


def test_full_disk_keeps_existing_outputs(folder):
    existing = {name: f"existing {name}" for name in ("o.mp4", "o.csv", "o.png")}
    for name, text in existing.items():
        Path(name).write_text(text)
    outputs = ("--out", "o.mp4", "--results", "o.csv", "--plot", "o.png", "--overwrite")
    done = run("track", "clip.mp4", *TRACK, *outputs, preexec_fn=_limit_file_size(30_000))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert (
        "o.mp4: cannot be written (File too large); what was written is in o.part.mp4"
        in done.stderr
    )
    assert "results: o.part.csv" in done.stdout
    assert {name: Path(name).read_text() for name in existing} == existing
    rows = rows_of(Path("o.part.csv"))
    assert 1 < len(rows) < COUNT
    assert None not in rows[-1].values()


@pytest.mark.parametrize("kind", ["cvat", "coco", "labelstudio", "got10k"])
def test_full_disk_keeps_existing_export(folder, kind):
    assert main(["track", "clip.mp4", *TRACK, "--results", "r.csv"]) == 0
    Path("o").write_text("existing")
    words = ["export", "r.csv", "--to", kind, "--video", "clip.mp4", "--out", "o", "--overwrite"]
    done = run(*words, preexec_fn=_limit_file_size(500))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "o: cannot be written (File too large)" in done.stderr
    assert Path("o").read_text() == "existing"
    assert not list(folder.glob("*.part*"))


def test_full_disk_keeps_existing_plot(folder):
    Path("o.png").write_text("existing")
    words = ["track", "clip.mp4", *TRACK, "--plot", "o.png", "--overwrite"]
    done = run(*words, preexec_fn=_limit_file_size(500))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "o.png: cannot be written (File too large)" in done.stderr
    assert Path("o.png").read_text() == "existing"
    assert not list(folder.glob("*.part*"))


def test_pipes_as_outputs_are_written_directly(folder):
    assert main(["track", "clip.mp4", *TRACK, "--results", "r.csv"]) == 0
    words = ["export", "r.csv", "--to", "coco", "--size", "320x240", "--fps", "25"]
    done = run(*words, "--out", "/dev/stdout")
    assert done.returncode == 0
    assert len(json.loads(done.stdout)["images"]) == COUNT
    for name in ("v.mkv", "t.csv"):
        os.mkfifo(name)
    readers = [
        subprocess.Popen(["dd", f"if={name}", f"of=copy-{name}", "status=none"])
        for name in ("v.mkv", "t.csv")
    ]
    done = run("track", "clip.mp4", *TRACK, "--out", "v.mkv", "--results", "t.csv")
    assert done.returncode == 0, done.stderr
    assert [reader.wait(timeout=60) for reader in readers] == [0, 0]
    assert len(decoded("copy-v.mkv")[0]) == len(rows_of(Path("copy-t.csv"))) == COUNT
    assert not list(folder.glob("*.part*"))
