"""The README's first example and the demo, run as they are."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]


def test_first_example_runs_and_ends_on_the_walker():
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
    assert len([line for line in code.splitlines() if line.strip()]) == 6
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    last_xywh = np.array([float(v) for v in re.findall(r"-?\d+\.\d+", done.stdout)])
    truth = np.loadtxt(ROOT / "examples" / "shaky-walker.txt", delimiter=",")[-1]
    assert np.hypot(*(last_xywh[:2] - truth[:2])) < 15


def run_demo(out, *options):
    """Number of frames in which the demo tracked the walker, by stabilization method."""
    command = [sys.executable, str(ROOT / "examples" / "demo.py"), "--out", str(out), *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    counts = re.findall(r"stabilize=(\w+).*? in +(\d+) of 117", done.stdout)
    return {stabilize: int(frames) for stabilize, frames in counts}


def test_the_demo_runs_and_predict_tracks_the_walker(tmp_path):
    tracked = run_demo(tmp_path)
    assert tracked["predict"] > max(100, tracked["off"] - 5)
    images = ("comparison.png", "paper-path.png", "predict-path.png")
    for name in ("off.mp4", "paper.mp4", "predict.mp4", *images):
        assert (tmp_path / name).stat().st_size > 10_000


def test_stabilization_tracks_the_walker_with_a_weaker_tracker(tmp_path):
    tracked = run_demo(tmp_path, "--tracker", "csrt")
    assert min(tracked["paper"], tracked["predict"]) > tracked["off"] + 20
