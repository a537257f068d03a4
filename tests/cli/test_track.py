"""`ssiam track`: arguments, outputs and help."""

import json
import subprocess
import sys
from fractions import Fraction

import cv2
import numpy as np
import pytest

from helpers.tracked_clip import BOX, COUNT, SIZE, box_of, decoded, rows_of, run
from ssiam.cli import main


def test_default_outputs_are_named_after_the_source(clip, tmp_path):
    path, truth = clip
    done = run("track", path, "--box", box_of(BOX), "--tracker", "kcf", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == ""  # no progress bar without a terminal
    assert f"tracked {COUNT} frames" in done.stdout
    frames, rate = decoded(tmp_path / "clip-tracked.mp4")
    assert len(frames) == COUNT
    assert rate == Fraction(30000, 1001)
    rows = rows_of(tmp_path / "clip-tracked.csv")
    assert len(rows) == COUNT
    for row, (x, y, _, _) in zip(rows, truth, strict=True):
        assert np.hypot(float(row["x"]) - x, float(row["y"]) - y) < 10


def test_all_outputs_together(clip, tmp_path, capsys):
    out, results, plot = (tmp_path / name for name in ("o.mp4", "r.jsonl", "p.png"))
    arguments = ["track", str(clip[0]), "--box", box_of(BOX), "--tracker", "kcf", "--side-by-side"]
    assert (
        main([*arguments, "--out", str(out), "--results", str(results), "--plot", str(plot)]) == 0
    )
    frames, _ = decoded(out)
    assert frames[0].width == 2 * frames[0].height * SIZE[0] // SIZE[1]
    assert len([json.loads(line) for line in results.read_text().splitlines()]) == COUNT
    assert cv2.imread(str(plot)).std() > 10
    output = capsys.readouterr().out
    assert all(str(path) in output for path in (out, results, plot))


@pytest.mark.parametrize("stabilize", ["off", "paper", "literal", "predict"])
def test_stabilization_methods(clip, tmp_path, stabilize):
    path, truth = clip
    results = tmp_path / "r.csv"
    arguments = ["--tracker", "csrt", "--stabilize", stabilize, "--results", str(results)]
    assert main(["track", str(path), "--box", box_of(BOX), *arguments]) == 0
    found = [[float(row[key]) for key in "xywh"] for row in rows_of(results)]
    assert np.abs(np.subtract(found, truth)[:, :2]).mean() < 4


def test_template_memory_and_distractors_are_options(clip, tmp_path):
    path, truth = clip
    results = tmp_path / "r.csv"
    arguments = ["--template-memory", "--no-distractors", "--results", str(results)]
    assert main(["track", str(path), "--box", box_of(BOX), *arguments]) == 0
    for row, (x, y, _, _) in zip(rows_of(results), truth, strict=True):
        assert np.hypot(float(row["x"]) - x, float(row["y"]) - y) < 10


def test_targets_share_one_camera_motion(clip, tmp_path):
    results = tmp_path / "r.csv"
    boxes = ["--box", box_of(BOX), "--box", "40,30,50,50", "--box", "220,150,40,40"]
    assert main(["track", str(clip[0]), *boxes, "--tracker", "kcf", "--results", str(results)]) == 0
    rows = rows_of(results)
    assert len(rows) == 3 * COUNT
    for frame in range(1, COUNT):
        motions = {row["dx"] for row in rows if row["frame"] == str(frame)}
        assert len(motions) == 1


def test_number_of_threads_does_not_change_results(clip, tmp_path, capsys):
    for threads in (1, 2):
        out = tmp_path / f"{threads}.csv"
        arguments = ["track", str(clip[0]), "--box", box_of(BOX), "--box", "20,20,40,30"]
        assert (
            main([*arguments, "--tracker", "kcf", "--results", str(out), "--threads", str(threads)])
            == 0
        )
    assert (tmp_path / "1.csv").read_text() == (tmp_path / "2.csv").read_text()


def test_stabilization_options_change_the_result(clip, tmp_path):
    def results_with(*options):
        results = tmp_path / "r.csv"
        arguments = ["--tracker", "kcf", "--stabilize", "paper", "--results", str(results)]
        arguments += ["--overwrite"]
        arguments += options
        assert main(["track", str(clip[0]), "--box", box_of(BOX), *arguments]) == 0
        return results.read_text()

    assert results_with("--window", "2") != results_with()
    assert (
        results_with("--keypoints", "gftt", "--fit", "least_squares", "--thx1", "5")
        != results_with()
    )


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


def test_help_describes_the_options(capsys):
    main(["track", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    for word in (
        "--box",
        "--tracker",
        "--stabilize",
        "--thx1",
        "THx1 of eq. 6",
        "pixels",
        "[default",
    ):
        assert word in text


def test_heavy_dependencies_are_not_imported_without_need(clip, tmp_path):
    code = (
        "import sys; from ssiam.cli import main;"
        f"main(['track', {str(clip[0])!r}, '--box', {box_of(BOX)!r}, '--tracker', 'kcf',"
        f" '--results', {str(tmp_path / 'r.csv')!r}]);"
        "print(sorted({'torch', 'openvino', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines()[-1] == "[]"
