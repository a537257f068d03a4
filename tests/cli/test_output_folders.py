"""Output folders: never over an input, and written completely or not at all."""

from __future__ import annotations

import os
import resource
import shutil
import signal
from pathlib import Path

import pytest

from helpers.tracked_clip import run
from helpers.vot_sequences import write_sequence
from ssiam.cli import main

CONFIG = """\
steps = 1
batch = 1
[network]
begin = "{begin}"
[teacher]
weights = "teacher"
[[sources]]
layout = "clip"
path = "data"
"""


@pytest.fixture
def folder(dataset, tmp_path, monkeypatch):
    """The current folder with a dataset, weights, a workspace and a training config."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(dataset, "data")
    Path("same").symlink_to("data")
    Path("vot/ants").mkdir(parents=True)
    write_sequence(Path("vot/ants"), 90)
    Path("vot/list.txt").write_text("ants\n")
    Path("ws").mkdir()
    Path("ws/sequences").symlink_to("../vot")
    Path("ws/stack.yaml").write_text("title: custom\nexperiments: {}\n")
    for name in ("run", "teacher", "siamfc"):
        Path(name).mkdir()
    Path("run/weights.pth").write_text("weights")
    Path("teacher/head.onnx").write_text("onnx")
    Path("student").mkdir()
    os.link("teacher/head.onnx", "student/search.onnx")
    Path("siamfc/search.onnx").write_text("a checkpoint with an unusual name")
    Path("begin.toml").write_text(CONFIG.format(begin="run/weights.pth"))
    return tmp_path


def file_contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


WORKSPACE = ("vot-workspace", "ws", "--force")
INPUTS = [
    # name of the case, arguments, words of the message
    ("bench", ("bench", "data", "--out", "same", "--trackers", "kcf"), "the dataset data"),
    ("tune", ("tune", "data", "--out", "./data", "--trackers", "kcf"), "the dataset data"),
    ("tables", ("tables", "run", "--dataset", "data", "--out", "same"), "the dataset data"),
    (
        "tables among frames",
        ("tables", "run", "--dataset", "data", "--out", "data/clip0/img"),
        "data/clip0/img holds frames of the dataset",
    ),
    ("workspace's list", (*WORKSPACE, "--sequences", "vot"), "sequences' list vot/list.txt"),
    ("workspace's stack", (*WORKSPACE, "--stack", "ws/stack.yaml"), "the stack ws/stack.yaml"),
    (
        "weights export",
        ("weights", "export", "siamfc", "siamfc/search.onnx", "--out", "."),
        "the weights siamfc/search.onnx",
    ),
    ("training", ("train", "begin.toml", "--out", "run"), "the weights run/weights.pth"),
    ("teacher", ("train", "begin.toml", "--out", "student"), "the teacher teacher/head.onnx"),
    ("so far", ("train", "begin.toml", "--so-far", "run"), "the weights run/weights.pth"),
]


@pytest.mark.parametrize(
    ("arguments", "named"), [i[1:] for i in INPUTS], ids=[i[0] for i in INPUTS]
)
def test_output_folder_that_is_an_input_is_refused(folder, arguments, named, capsys):
    if arguments[0] == "train":
        pytest.importorskip("torch")
    if arguments[0] == "vot-workspace":
        pytest.importorskip("trax")
    before = file_contents(folder)
    assert main(list(arguments)) == 2
    captured = capsys.readouterr()
    assert named in captured.err
    assert captured.err.startswith("ssiam: ")
    assert captured.err.count("\n") == 1
    assert file_contents(folder) == before


def _limit_file_size(limit):
    def set_limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return set_limit


def test_full_disk_keeps_existing_page(folder):
    assert main(["bench", "data", "--out", "runs", "--trackers", "kcf", "--stabilize", "off"]) == 0
    Path("page").mkdir()
    for name in ("tables.md", "tables.html"):
        Path("page", name).write_text("existing")
    arguments = ["tables", "runs", "--dataset", "data", "--no-figures", "--out", "page"]
    done = run(*arguments, preexec_fn=_limit_file_size(400))
    assert (done.returncode, done.stderr.splitlines()[-1].startswith("ssiam: page/")) == (2, True)
    assert {path.name: path.read_text() for path in Path("page").iterdir()} == {
        "tables.md": "existing",
        "tables.html": "existing",
    }


def test_full_disk_keeps_existing_workspace(folder):
    pytest.importorskip("trax")
    Path("new").mkdir()
    Path("new/trackers.ini").write_text("existing")
    arguments = ["vot-workspace", "new", "--force", "--sequences", "vot", "--trackers", "kcf"]
    done = run(*arguments, preexec_fn=_limit_file_size(200))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "new/trackers.ini: cannot be written (File too large)" in done.stderr
    assert Path("new/trackers.ini").read_text() == "existing"


def test_full_disk_keeps_existing_imported_weights(folder, monkeypatch):
    pytest.importorskip("torch")
    pytest.importorskip("onnx")
    from helpers import network_models as models

    assert (
        main(["weights", "export", "siamfc", str(models.checkpoint("siamfc")), "--out", "o"]) == 0
    )
    assert main(["weights", "import", "o/siamfc", "--folder", "kept"]) == 0
    before = file_contents(folder)
    done = run(
        *("weights", "import", "o/siamfc", "--folder", "kept"), preexec_fn=_limit_file_size(100_000)
    )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert file_contents(folder) == before
