"""The README's first example, run as it stands."""

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
    found = np.array([float(v) for v in re.findall(r"-?\d+\.\d+", done.stdout)])
    truth = np.loadtxt(ROOT / "examples" / "shaky-walker.txt", delimiter=",")[-1]
    assert np.hypot(*(found[:2] - truth[:2])) < 15


def demonstrated(out, *options):
    """In how many frames each steadying held the walker."""
    command = [sys.executable, str(ROOT / "examples" / "demo.py"), "--out", str(out), *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    held = re.findall(r"stabilize=(\w+).*? in +(\d+) of 117", done.stdout)
    return {stabilize: int(frames) for stabilize, frames in held}


def test_the_demo_runs_and_the_predicted_view_holds_the_walker(tmp_path):
    held = demonstrated(tmp_path)
    assert held["predict"] > max(100, held["off"] - 5)
    pictures = ("comparison.png", "paper-path.png", "predict-path.png")
    for name in ("off.mp4", "paper.mp4", "predict.mp4", *pictures):
        assert (tmp_path / name).stat().st_size > 10_000


def test_steadying_holds_the_walker_with_a_weaker_tracker(tmp_path):
    held = demonstrated(tmp_path, "--tracker", "csrt")
    assert min(held["paper"], held["predict"]) > held["off"] + 20
