"""Run the README's first example, and the demo."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]


def test_the_first_example_tracks_the_walker_to_the_end():
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
    assert len([line for line in code.splitlines() if line.strip()]) == 6
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    found = np.array([float(v) for v in re.findall(r"-?\d+\.\d+", done.stdout)])
    truth = np.loadtxt(ROOT / "examples" / "shaky-walker.txt", delimiter=",")[-1]
    assert np.hypot(*(found[:2] - truth[:2])) < 15


def frames_by_method(out, *options):
    """The number of frames in which each stabilization method tracked the walker."""
    command = [sys.executable, str(ROOT / "examples" / "demo.py"), "--out", str(out), *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    found = re.findall(r"stabilize=(\w+).*? in +(\d+) of 117", done.stdout)
    return {stabilize: int(frames) for stabilize, frames in found}


def test_the_demo_tracks_the_walker_on_the_predicted_view(tmp_path):
    frames = frames_by_method(tmp_path)
    assert frames["predict"] > max(100, frames["off"] - 5)
    images = ("comparison.png", "paper-path.png", "predict-path.png")
    for name in ("off.mp4", "paper.mp4", "predict.mp4", *images):
        assert (tmp_path / name).stat().st_size > 10_000


def test_stabilization_helps_a_weaker_tracker(tmp_path):
    frames = frames_by_method(tmp_path, "--tracker", "csrt")
    assert min(frames["paper"], frames["predict"]) > frames["off"] + 20
