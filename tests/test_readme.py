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


def test_the_demo_runs_and_steadying_holds_the_walker(tmp_path):
    command = [sys.executable, str(ROOT / "examples" / "demo.py"), "--out", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    held = dict(re.findall(r"stabilize=(\w+).*? in +(\d+) of 117", done.stdout))
    assert min(int(held["paper"]), int(held["predict"])) > int(held["off"]) + 20
    pictures = ("comparison.png", "paper-path.png", "predict-path.png")
    for name in ("off.mp4", "paper.mp4", "predict.mp4", *pictures):
        assert (tmp_path / name).stat().st_size > 10_000
