"""Measures against the official vot-toolkit 0.7.4, which runs in a separate interpreter.

Skipped unless SSIAM_VOT_PYTHON names one:

    python3.11 -m venv vot-env
    vot-env/bin/pip install "vot-toolkit==0.7.4" "attributee==0.1.9" vot-trax
    SSIAM_VOT_PYTHON=vot-env/bin/python pytest tests/evaluation/test_official_toolkit.py

Newer versions of the toolkit cannot run supervised experiments. The test takes about two minutes,
most of it for the compiler of the toolkit.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures import vot_toolkit
from ssiam.evaluation.measures.eao import Interval
from ssiam.evaluation.measures.overlap import toolkit_overlap
from ssiam.evaluation.runs.result_files import read_results

# Not resolved: the interpreter of a virtual environment is a link, and `vot` is next to the link.
PYTHON = Path(os.environ.get("SSIAM_VOT_PYTHON", "")).absolute()

pytestmark = pytest.mark.skipif(
    not PYTHON.is_file(), reason="SSIAM_VOT_PYTHON names no interpreter with vot-toolkit"
)

TRACKERS = ("Still", "NCC", "Cheat", "CheatPoly")
INTERVAL = Interval(20, 60)
BOUNDS = (80, 60)

OVERLAPS = """
import sys
import numpy as np
from vot.region import Polygon, Rectangle, Special, calculate_overlaps

def region(row):
    row = [float(v) for v in row[~np.isnan(row)]]
    if len(row) == 4:
        return Rectangle(*row)
    return Polygon(list(zip(row[::2], row[1::2]))) if row else Special(0)

data = np.load(sys.argv[1])
sides = [[region(row) for row in data[side]] for side in "ab"]
np.save(sys.argv[2], calculate_overlaps(*sides, tuple(data["bounds"].tolist())))
"""


def official(arguments, **options):
    environment = {**os.environ, "VOT_RESULTS_BINARY": "0", **options.pop("env", {})}
    done = subprocess.run(
        [*map(str, arguments)], capture_output=True, text=True, env=environment, **options
    )
    assert done.returncode == 0, done.stdout + done.stderr


def regions(rng, count):
    """Pairs of regions: subpixel and integer, flat and empty, inside, outside and crossing."""
    size = rng.choice([0.4, 3, 30], (count, 1))
    a = rng.normal(0, 1, (count, 8)) * size + np.tile(rng.uniform(-20, 90, (count, 2)), 4)
    b = a + rng.normal(0, 1, (count, 8)) * rng.choice([0, 0.5, 5, 50], (count, 1))
    a[::5], b[::7] = np.round(a[::5] * 2) / 2, np.round(b[::7] * 2) / 2
    a[::3, 4:], b[::4, 4:] = np.nan, np.nan
    a[::3, 2:4] = np.abs(a[::3, 2:4]) - 2
    a[::11], b[::13] = np.nan, np.nan
    return a, b


def test_overlaps_are_equal(tmp_path):
    a, b = regions(np.random.default_rng(0), 20_000)
    np.savez(tmp_path / "in.npz", a=a, b=b, bounds=BOUNDS)
    official([PYTHON, "-c", OVERLAPS, tmp_path / "in.npz", tmp_path / "out.npy"])
    np.testing.assert_allclose(
        toolkit_overlap(a, b, BOUNDS), np.load(tmp_path / "out.npy"), atol=1e-9
    )


def test_scores_of_a_workspace_are_equal(shared, tmp_path):
    maker = shared("bench/make_vot_workspace.py")
    official([PYTHON, maker, tmp_path, "--frames", "90", "--interpreter", PYTHON])
    vot = PYTHON.parent / "vot"
    official([vot, "evaluate", *TRACKERS], cwd=tmp_path)
    official([vot, "analysis", "--name", "all", *TRACKERS], cwd=tmp_path)
    document = json.loads((tmp_path / "analysis" / "all.json").read_text())
    averages, _, _, eao, _ = document["results"]["baseline"]["results"]
    sequences = [
        VideoSequence(
            path.name, (), np.loadtxt(path / "groundtruth.txt", delimiter=","), size_wh=(320, 240)
        )
        for path in sorted(p for p in (tmp_path / "sequences").iterdir() if p.is_dir())
    ]
    for index, name in enumerate(TRACKERS):
        results = read_results(tmp_path / "results" / name, sequences)
        found = vot_toolkit.scores(results.tracked, INTERVAL)
        accuracy, robustness, point, length = averages[index]
        assert found.accuracy == pytest.approx(accuracy, abs=1e-6), name
        assert found.robustness == pytest.approx(robustness, abs=1e-9), name
        assert found.eao == pytest.approx(eao[index][0], abs=1e-6), name
        assert found.frames == length * len(sequences)
        assert vot_toolkit.ar_point(found, len(sequences)) == pytest.approx(point, abs=1e-6)
