"""Compare A, R and EAO of this package with those of the official VOT toolkit.

    python scripts/official_toolkit.py [--environment DIR] [--workspace DIR]

Creates an environment with vot-toolkit if there is none, and renders three short sequences with a
shaking camera. The toolkit evaluates and analyzes CSRT, without stabilization and on the
stabilized view, through `ssiam trax`. `ssiam.evaluation.measures.vot_toolkit` then computes the
measures from the same results. The exit code is 1 if a measure differs by more than 0.001.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ssiam.datasets import open_dataset
from ssiam.evaluation.measures import vot_toolkit
from ssiam.evaluation.measures.eao import Interval
from ssiam.evaluation.runs.result_files import read_results
from ssiam.geometry import corners_from_xywh, frame_center, map_points, rigid

PINS = ("vot-toolkit==0.7.4", "attributee==0.1.9")  # later versions fail when supervised
INTERPRETERS = ("python3.11", sys.executable)
TOLERANCE = 1e-3

LABELS = ("csrt-off", "csrt-paper")
MEASURES = ("A", "R", "EAO")

SIZE = (320, 240)  # px
FRAMES = 75
TARGET = (46, 34)  # px
# Sequence: standard deviation of the camera's shift, px, and roll, radians; frames at which the
# target jumps away, so that every tracker loses it.
SEQUENCES: dict[str, tuple[float, float, tuple[int, ...]]] = {
    "calm": (0.5, 0.0, ()),
    "shaky": (5.0, 0.015, (50,)),
    "leaps": (2.0, 0.005, (20, 45, 73)),
}


def main() -> int:
    """Run the comparison and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--environment", type=Path, default=Path("build/vot-toolkit"))
    parser.add_argument("--workspace", type=Path, help="new folder, which is kept")
    arguments = parser.parse_args()
    toolkit = environment(arguments.environment)
    with tempfile.TemporaryDirectory() as temporary:
        folder = (arguments.workspace or Path(temporary) / "workspace").absolute()
        for index, name in enumerate(SEQUENCES):
            write_sequence(folder / "sequences" / name, index)
        run(sys.executable, "-m", "ssiam", "vot-workspace", folder)
        output = run(toolkit, "-m", "vot", "evaluate", "--workspace", folder, *LABELS)
        output += run(toolkit, "-m", "vot", "analysis", "--workspace", folder, "--name", "all")
        report = folder / "analysis" / "all.json"
        if not report.is_file():
            sys.exit(f"{output}\nthe toolkit wrote no analysis; its output is above")
        return compare(json.loads(report.read_text(encoding="utf-8")), folder)


def environment(folder: Path) -> Path:
    """The Python of an environment with the toolkit, created or completed if necessary."""
    python = folder.absolute() / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        print(f"installing {' '.join(PINS)} into {folder}")
        run(interpreter(), "-m", "venv", folder)
    run(python, "-m", "pip", "install", "--quiet", "--no-compile", *PINS)
    return python


def interpreter() -> str:
    """A Python that can create environments: 3.11 if installed, otherwise the running one."""
    for name in INTERPRETERS:
        try:
            subprocess.run([name, "-c", "import ensurepip"], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            continue
        return name
    sys.exit(
        f"none of {', '.join(INTERPRETERS)} can create an environment: install python3.11-venv"
    )


def run(*command: str | Path) -> str:
    """The output of a command; exits if it fails."""
    words = [str(word) for word in command]
    # 0: result files are texts.
    variables = {**os.environ, "VOT_RESULTS_BINARY": "0"}
    done = subprocess.run(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=variables
    )
    if done.returncode:
        sys.exit(f"{done.stdout}\n{' '.join(words)} failed with exit code {done.returncode}")
    return done.stdout


def write_sequence(folder: Path, seed: int) -> None:
    """Render a moving target on a background, seen by a shaking camera, in VOT's layout."""
    shake, roll, jumps = SEQUENCES[folder.name]
    random = np.random.Generator(np.random.PCG64(seed))
    (width, height), (w, h) = SIZE, TARGET
    background = texture(random, (width, height), 12)
    target = texture(random, TARGET, 7)
    (folder / "color").mkdir(parents=True)
    truth = []
    for index, (x, y) in enumerate(target_path(jumps)):
        scene = background.copy()
        scene[y : y + h, x : x + w] = target
        dx, dy, angle = random.normal(0, (shake, shake, roll))
        frame_from_world = rigid(dx, dy, angle, frame_center(SIZE))
        frame = cv2.warpAffine(scene, frame_from_world[:2], SIZE, borderMode=cv2.BORDER_REFLECT)
        cv2.imwrite(str(folder / "color" / f"{index + 1:08d}.jpg"), frame)
        corners = map_points(frame_from_world, corners_from_xywh((x, y, w - 1, h - 1)))
        truth.append(",".join(f"{value:.3f}" for value in corners.ravel()))
    (folder / "groundtruth.txt").write_text("\n".join(truth) + "\n")
    (folder / "sequence").write_text(
        f"name={folder.name}\nfps=30\nformat=default\nchannel.default=color\n"
        f"channels.color=color/%08d.jpg\nwidth={width}\nheight={height}\nlength={FRAMES}\n"
    )


def texture(random: np.random.Generator, size_wh: tuple[int, int], cell: int) -> Any:
    """Random colors in cells of `cell` pixels, with noise per pixel: (H, W, 3) uint8."""
    width, height = size_wh
    shape = (height // cell + 1, width // cell + 1, 3)
    colors = random.integers(30, 226, shape).astype(np.uint8)
    coarse = np.kron(colors, np.ones((cell, cell, 1), np.uint8))[:height, :width]
    return cv2.add(coarse, random.integers(0, 30, coarse.shape).astype(np.uint8))


def target_path(jumps: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """Top left corner of the target in each frame, world pixels."""
    side = 0
    for index in range(FRAMES):
        side ^= index in jumps
        yield 45 + 140 * side + round(25 * np.sin(index / 9)), 100 + round(40 * np.cos(index / 14))


def compare(report: dict[str, Any], folder: Path) -> int:
    """Print the toolkit's measures and ours; returns 1 if they differ, else 0."""
    baseline = report["results"]["baseline"]
    averages, means, _ = baseline["results"]
    limits = next(entry for entry in baseline["parameters"]["analyses"] if "high" in entry)
    interval = Interval(limits["low"], limits["high"])
    sequences = open_dataset(folder / "sequences", "vot").sequences.values()
    differences = []
    print(f"{'tracker':12s}{'measure':>8s}{'vot-toolkit':>14s}{'ssiam':>10s}")
    for label, (accuracy, lost, *_), (eao,) in zip(
        report["trackers"], averages, means, strict=True
    ):
        results = read_results(folder / "results" / label, sequences)
        scores = vot_toolkit.scores(results.tracked, interval)
        ours = (scores.accuracy, scores.robustness, scores.eao)
        for measure, official, own in zip(MEASURES, (accuracy, lost, eao), ours, strict=True):
            print(f"{label:12s}{measure:>8s}{official:14.4f}{own:10.4f}")
            differences.append(abs(official - own))
    agree = all(difference <= TOLERANCE for difference in differences)  # false for nan
    print(f"largest difference {max(differences):.6f}: {'equal' if agree else 'DIFFERENT'}")
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
