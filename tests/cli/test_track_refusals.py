"""Input that `ssiam track` refuses, with a one-line error that names it."""

import pytest

from helpers.tracked_clip import BOX, box_of, run
from ssiam.cli import main


@pytest.fixture(scope="module")
def inputs(clip, tmp_path_factory):
    """A folder of files that are not videos."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "text.mp4").write_text("this is not a video\n")
    (folder / "empty").mkdir()
    (folder / "html").mkdir()
    (folder / "001").mkdir()
    for part in ("backbone", "head"):
        (folder / "html" / f"{part}.onnx").write_text("<!DOCTYPE html><html>sign in</html>")
    return folder


CLIP_BOX = ("CLIP", "--box", box_of(BOX))
CSRT = ("--tracker", "csrt")
NANO = ("--tracker", "nanotrack_v2")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(("nofile.mp4", "--box", "1,2,3,4"), "nofile.mp4", id="missing file"),
        pytest.param(("text.mp4", "--box", "1,2,3,4"), "text.mp4", id="text called mp4"),
        pytest.param(("empty", "--box", "1,2,3,4"), "empty", id="empty folder"),
        pytest.param(("CLIP",), "--box", id="no box"),
        pytest.param(("CLIP", "--box", "1,2,3"), "'1,2,3'", id="three numbers"),
        pytest.param(("CLIP", "--box", "a,b,c,d"), "'a,b,c,d'", id="words"),
        pytest.param(("CLIP", "--box", "nan,1,9,9"), "(nan, 1.0, 9.0, 9.0)", id="nan"),
        pytest.param(("CLIP", "--box", "5,5,0,9"), "(5.0, 5.0, 0.0, 9.0)", id="zero width"),
        pytest.param(("CLIP", "--box", "50,40,-20,-10"), "-20.0", id="swapped corners"),
        pytest.param(("CLIP", "--box", "999,5,9,9"), "outside", id="outside"),
        pytest.param((*CLIP_BOX, "--tracker", "magic"), "nanotrack_v3", id="unknown tracker"),
        pytest.param((*CLIP_BOX, *NANO), "needs weights", id="weights not given"),
        pytest.param(
            (*CLIP_BOX, *NANO), "--weights PATH", id="weights not given, names the option"
        ),
        pytest.param(("001", "--box", "1,2,3,4"), "give ./001", id="folder named like a camera"),
        pytest.param((*CLIP_BOX, *NANO, "--weights", "missing"), "missing", id="weights missing"),
        pytest.param((*CLIP_BOX, *NANO, "--weights", "html"), "web page", id="weights html"),
        pytest.param(
            (*CLIP_BOX, *CSRT, "--weights", "html"),
            "csrt has no weights",
            id="weights without a network",
        ),
        pytest.param((*CLIP_BOX, *NANO, "--precision", "f16"), "'f16'", id="no such precision"),
        pytest.param((*CLIP_BOX, *NANO, "--device", "cuda"), "'cuda'", id="no such device"),
        pytest.param(
            (*CLIP_BOX, *CSRT, "--precision", "bf16"),
            "csrt has no network",
            id="precision without a network",
        ),
        pytest.param(
            (*CLIP_BOX, *CSRT, "--template-memory"),
            "csrt cannot search around",
            id="memory without a search",
        ),
        pytest.param(
            (*CLIP_BOX, *CSRT, "--distractors"),
            "csrt has no score map",
            id="distractors without a score map",
        ),
        pytest.param((*CLIP_BOX, "--out", "missing/o.mp4"), "missing", id="no output folder"),
        pytest.param((*CLIP_BOX, "--out", "empty"), "empty", id="output is a folder"),
        pytest.param((*CLIP_BOX, "--out", "/proc/o.mp4"), "/proc", id="folder not writable"),
        pytest.param((*CLIP_BOX, "--out", "o.xyz"), "o.xyz", id="unknown kind of output"),
        pytest.param((*CLIP_BOX, "--results", "missing/r.csv"), "missing", id="no results folder"),
        pytest.param((*CLIP_BOX, "--plot", "missing/p.png"), "missing", id="no plot folder"),
        pytest.param((*CLIP_BOX, "--layout", "x", "--results", "r.txt"), "'x'", id="layout"),
        pytest.param((*CLIP_BOX, "--stabilize", "magic"), "paper", id="unknown stabilization"),
        pytest.param(
            (*CLIP_BOX, "--keypoints", "magic"), 'Choose from: "direct", "orb"', id="keypoints"
        ),
        pytest.param(
            (*CLIP_BOX, "--motion-model", "magic"), 'from: "rigid", "similarity"', id="model"
        ),
        pytest.param(
            (*CLIP_BOX, "--stabilize", "paper", "--motion-model", "mesh"),
            """motion_model "mesh" is given with keypoints 'orb'""",
            id="mesh of keypoints",
        ),
        pytest.param((*CLIP_BOX, "--window", "0"), "window", id="limit out of range"),
        pytest.param((*CLIP_BOX, "--windw", "9"), "--windw", id="unknown option"),
        pytest.param(("-", "--box", "1,2,3,4", "--raw", "7"), "'7'", id="raw format"),
    ],
)
def test_invalid_input_gives_one_line_error(inputs, clip, arguments, named, capsys, monkeypatch):
    monkeypatch.chdir(inputs)
    before = sorted(inputs.iterdir())
    code = main(["track", *(str(clip[0]) if a == "CLIP" else a for a in arguments)])
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert captured.err.startswith("ssiam: ")
    assert named in captured.err
    assert captured.err.count("\n") == 1
    assert sorted(inputs.iterdir()) == before


def test_weights_of_another_network(clip, shared, tmp_path):
    weights = shared("data/weights/nanotrackv3")
    done = run("track", clip[0], "--box", box_of(BOX), *NANO, "--weights", weights, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "another network than nanotrack_v2" in done.stderr
