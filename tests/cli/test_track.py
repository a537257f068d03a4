"""`ssiam track` from its arguments to its files, in real processes where it matters."""

import csv
import json
import signal
import subprocess
import sys
import time
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from ssiam.cli import main
from ssiam.geometry import map_box
from ssiam.video import VideoSink
from synthetic import generator, poses, seen, world

SIZE = (320, 240)
BOX = (140.0, 90.0, 36.0, 40.0)
COUNT = 40


def write_clip(path, count=COUNT, fps=Fraction(30000, 1001)):
    """A shaking clip, and the true place of BOX in each frame."""
    frame_from_world = poses(generator(2).normal(0, (3, 2, 0.004), (count, 3)), SIZE)
    picture = world(size_wh=SIZE)
    with VideoSink(path, fps) as sink:
        for pose in frame_from_world:
            sink.write(seen(picture, pose))
    start = np.linalg.inv(frame_from_world[0])
    return [map_box(pose @ start, BOX) for pose in frame_from_world]


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip.mp4"
    return path, write_clip(path)


def box_of(box):
    return ",".join(str(v) for v in box)


def decoded(path):
    with av.open(str(path)) as container:
        return list(container.decode(video=0)), container.streams.video[0].average_rate


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def run(*arguments, **options):
    """`ssiam` in a process of its own."""
    command = [sys.executable, "-m", "ssiam", *(str(a) for a in arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


def test_by_default_a_video_and_a_table_named_after_the_source(clip, tmp_path):
    path, truth = clip
    done = run("track", path, "--box", box_of(BOX), "--tracker", "kcf", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == ""  # no progress bar where there is no terminal
    assert f"tracked {COUNT} frames" in done.stdout
    frames, rate = decoded(tmp_path / "clip-tracked.mp4")
    assert len(frames) == COUNT
    assert rate == Fraction(30000, 1001)
    rows = rows_of(tmp_path / "clip-tracked.csv")
    assert len(rows) == COUNT
    for row, (x, y, _, _) in zip(rows, truth, strict=True):
        assert np.hypot(float(row["x"]) - x, float(row["y"]) - y) < 10


def test_every_output_at_once(clip, tmp_path, capsys):
    out, results, plot = (tmp_path / name for name in ("o.mp4", "r.jsonl", "p.png"))
    arguments = ["track", str(clip[0]), "--box", box_of(BOX), "--tracker", "kcf", "--side-by-side"]
    assert (
        main([*arguments, "--out", str(out), "--results", str(results), "--plot", str(plot)]) == 0
    )
    frames, _ = decoded(out)
    assert frames[0].width == 2 * frames[0].height * SIZE[0] // SIZE[1]
    assert len([json.loads(line) for line in results.read_text().splitlines()]) == COUNT
    assert cv2.imread(str(plot)).std() > 10
    told = capsys.readouterr().out
    assert all(str(path) in told for path in (out, results, plot))


@pytest.mark.parametrize("stabilize", ["off", "paper", "literal", "predict"])
def test_each_way_of_steadying(clip, tmp_path, stabilize):
    path, truth = clip
    results = tmp_path / "r.csv"
    arguments = ["--tracker", "csrt", "--stabilize", stabilize, "--results", str(results)]
    assert main(["track", str(path), "--box", box_of(BOX), *arguments]) == 0
    found = [[float(row[key]) for key in "xywh"] for row in rows_of(results)]
    assert np.abs(np.subtract(found, truth)[:, :2]).mean() < 4


def test_several_targets_share_one_motion(clip, tmp_path):
    results = tmp_path / "r.csv"
    boxes = ["--box", box_of(BOX), "--box", "40,30,50,50", "--box", "220,150,40,40"]
    assert main(["track", str(clip[0]), *boxes, "--tracker", "kcf", "--results", str(results)]) == 0
    rows = rows_of(results)
    assert len(rows) == 3 * COUNT
    for frame in range(1, COUNT):
        motions = {row["dx"] for row in rows if row["frame"] == str(frame)}
        assert len(motions) == 1


def test_a_second_core_changes_no_result(clip, tmp_path, capsys):
    for threads in (1, 2):
        out = tmp_path / f"{threads}.csv"
        arguments = ["track", str(clip[0]), "--box", box_of(BOX), "--box", "20,20,40,30"]
        assert (
            main([*arguments, "--tracker", "kcf", "--results", str(out), "--threads", str(threads)])
            == 0
        )
    assert (tmp_path / "1.csv").read_text() == (tmp_path / "2.csv").read_text()


def test_limits_are_options(clip, tmp_path):
    def steadied(*options):
        results = tmp_path / "r.csv"
        arguments = ["--tracker", "kcf", "--stabilize", "paper", "--results", str(results)]
        arguments += options
        assert main(["track", str(clip[0]), "--box", box_of(BOX), *arguments]) == 0
        return results.read_text()

    assert steadied("--window", "2") != steadied()
    assert steadied("--keypoints", "gftt", "--fit", "least_squares", "--thx1", "5") != steadied()


def test_frames_from_a_pipe(clip, tmp_path):
    frames, _ = decoded(clip[0])
    raw = b"".join(frame.to_ndarray(format="bgr24").tobytes() for frame in frames)
    command = [sys.executable, "-m", "ssiam", "track", "-", "--box", box_of(BOX)]
    command += ["--tracker", "kcf", "--raw", "320x240,bgr24,25", "--results", "r.csv"]
    done = subprocess.run(command, input=raw, cwd=tmp_path, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    rows = rows_of(tmp_path / "r.csv")
    assert len(rows) == COUNT
    assert float(rows[-1]["time"]) == pytest.approx((COUNT - 1) / 25, abs=1e-3)


@pytest.fixture(scope="module")
def inputs(clip, tmp_path_factory):
    """A folder of things that are no good videos."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "text.mp4").write_text("this is no video\n")
    (folder / "empty").mkdir()
    (folder / "html").mkdir()
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
        pytest.param((*CLIP_BOX, *NANO, "--weights", "gone"), "gone", id="weights missing"),
        pytest.param((*CLIP_BOX, *NANO, "--weights", "html"), "web page", id="weights html"),
        pytest.param(
            (*CLIP_BOX, *CSRT, "--weights", "html"), "csrt has no weights", id="weights in vain"
        ),
        pytest.param((*CLIP_BOX, *NANO, "--precision", "f16"), "'f16'", id="no such precision"),
        pytest.param((*CLIP_BOX, *NANO, "--device", "cuda"), "'cuda'", id="no such device"),
        pytest.param(
            (*CLIP_BOX, *CSRT, "--precision", "bf16"), "csrt has no network", id="in vain"
        ),
        pytest.param((*CLIP_BOX, "--out", "gone/o.mp4"), "gone", id="no output folder"),
        pytest.param((*CLIP_BOX, "--out", "empty"), "empty", id="output is a folder"),
        pytest.param((*CLIP_BOX, "--out", "/proc/o.mp4"), "/proc", id="folder not writable"),
        pytest.param((*CLIP_BOX, "--out", "o.xyz"), "o.xyz", id="unknown kind of output"),
        pytest.param((*CLIP_BOX, "--results", "gone/r.csv"), "gone", id="no results folder"),
        pytest.param((*CLIP_BOX, "--plot", "gone/p.png"), "gone", id="no plot folder"),
        pytest.param((*CLIP_BOX, "--layout", "x", "--results", "r.txt"), "'x'", id="layout"),
        pytest.param((*CLIP_BOX, "--stabilize", "magic"), "paper", id="unknown steadying"),
        pytest.param((*CLIP_BOX, "--window", "0"), "window", id="limit out of range"),
        pytest.param((*CLIP_BOX, "--windw", "9"), "--windw", id="unknown option"),
        pytest.param(("-", "--box", "1,2,3,4", "--raw", "7"), "'7'", id="raw format"),
    ],
)
def test_bad_input_is_one_line_that_names_it(inputs, clip, arguments, named, capsys, monkeypatch):
    monkeypatch.chdir(inputs)
    before = sorted(inputs.iterdir())
    code = main(["track", *(str(clip[0]) if a == "CLIP" else a for a in arguments)])
    told = capsys.readouterr()
    assert code == 2
    assert told.out == ""
    assert told.err.startswith("ssiam: ")
    assert named in told.err
    assert told.err.count("\n") == 1
    assert sorted(inputs.iterdir()) == before


def test_weights_of_another_network_in_a_process(clip, shared, tmp_path):
    weights = shared("data/weights/nanotrackv3")
    done = run("track", clip[0], "--box", box_of(BOX), *NANO, "--weights", weights, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "another network than nanotrack_v2" in done.stderr


def test_a_truncated_video_is_tracked_as_far_as_it_goes(tmp_path):
    write_clip(tmp_path / "whole.mkv")
    content = (tmp_path / "whole.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(content[: len(content) // 2])
    done = run("track", "cut.mkv", "--box", box_of(BOX), "--tracker", "kcf", cwd=tmp_path)
    assert done.returncode == 3
    assert done.stderr.startswith("ssiam: cut.mkv")
    assert done.stderr.count("\n") == 1
    rows = rows_of(tmp_path / "cut-tracked.csv")
    assert 5 < len(rows) < COUNT
    assert len(decoded(tmp_path / "cut-tracked.mp4")[0]) == len(rows)


def test_frames_that_change_their_size_keep_what_came_before(tmp_path):
    (tmp_path / "frames").mkdir()
    for index in range(8):
        size = SIZE if index < 6 else (160, 120)
        cv2.imwrite(str(tmp_path / "frames" / f"{index}.png"), world(size_wh=size))
    done = run("track", "frames", "--box", box_of(BOX), "--tracker", "kcf", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "160x120" in done.stderr
    assert len(rows_of(tmp_path / "frames-tracked.csv")) == 6
    assert len(decoded(tmp_path / "frames-tracked.mp4")[0]) == 6


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["ctrl-c", "terminated"]
)
def test_interrupted_runs_leave_whole_files(tmp_path, number, code):
    write_clip(tmp_path / "long.mp4", count=400)
    command = [sys.executable, "-m", "ssiam", "track", "long.mp4", "--box", box_of(BOX)]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    results = tmp_path / "long-tracked.csv"
    deadline = time.monotonic() + 60
    while not results.exists() or results.read_bytes().count(b"\n") < 15:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(number)
    told, complained = process.communicate(timeout=60)
    assert process.returncode == code
    assert complained == ""
    assert "long-tracked.mp4" in told
    text = results.read_text()
    assert text.endswith("\n")
    rows = rows_of(results)
    assert 10 < len(rows) < 400
    assert None not in rows[-1].values()
    assert abs(len(decoded(tmp_path / "long-tracked.mp4")[0]) - len(rows)) <= 1


def test_help_is_documentation(capsys):
    main(["track", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    for word in (
        "--box",
        "--tracker",
        "--stabilize",
        "--thx1",
        "THx1 of eq. 6",
        "pixels",
        "[default",
    ):
        assert word in told


def test_the_command_line_never_imports_torch_or_a_network_without_need(clip, tmp_path):
    code = (
        "import sys; from ssiam.cli import main;"
        f"main(['track', {str(clip[0])!r}, '--box', {box_of(BOX)!r}, '--tracker', 'kcf',"
        f" '--results', {str(tmp_path / 'r.csv')!r}]);"
        "print(sorted({'torch', 'openvino', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines()[-1] == "[]"
