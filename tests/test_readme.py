"""Run the README's first example."""

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
