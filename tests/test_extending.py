"""The tracker of docs/how-to/extend.md, from outside of the package; the checks of any tracker."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ssiam.geometry import iou
from ssiam.testing import CHECKS

ROOT = Path(__file__).parents[1]
CLIP = ROOT / "examples" / "shaky-walker.mp4"
NAME = "my_tracker:CorrelationTracker"


@pytest.fixture(scope="module")
def source():
    """The page's first block of Python: the module."""
    page = (ROOT / "docs" / "how-to" / "extend.md").read_text(encoding="utf-8")
    return re.search(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)[1]


@pytest.fixture
def run(tmp_path, source):
    """Runs `ssiam` in a folder with the module, as the page does."""
    (tmp_path / "my_tracker.py").write_text(source, encoding="utf-8")

    def run(*words):
        return subprocess.run(
            [sys.executable, "-m", "ssiam", *words],
            cwd=tmp_path,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]),
            },
            capture_output=True,
            text=True,
            timeout=600,
        )

    return run


def test_the_pages_tracker_is_short(source):
    assert "class CorrelationTracker" in source
    assert len(source.splitlines()) <= 40


def test_the_pages_tracker_tracks_the_shaking_walker(run, tmp_path):
    done = run("track", str(CLIP), "--box", "53,114,26,66", "--end", "24", "--tracker", NAME,
               "--results", "out.csv")  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = [line.split(",") for line in (tmp_path / "out.csv").read_text().splitlines()]
    columns = [rows[0].index(name) for name in ("x", "y", "w", "h")]
    boxes = np.array([[float(row[column]) for column in columns] for row in rows[1:]])
    truth = np.loadtxt(ROOT / "examples" / "shaky-walker.txt", delimiter=",")[:25]
    assert iou(boxes, truth).mean() > 0.5


def test_the_pages_tracker_passes_all_checks(run):
    done = run("check-tracker", NAME)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    lines = done.stdout.splitlines()
    assert len(lines) == len(CHECKS)
    others = [line for line in lines if not line.startswith("ok ")]
    assert others == ["none   the best candidate is the result of update"]  # it lists none
