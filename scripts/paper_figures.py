"""Make the figures of docs/explanation/paper.md: `ssiam bench` and `ssiam tables` on the demo clip.

    python scripts/paper_figures.py [--keep FOLDER]

The clip shakes already. Three further sequences are the same clip with another shake added.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

import cv2
import numpy as np

from ssiam.cli import main as ssiam
from ssiam.datasets import Shake, VideoSequence, shaken
from ssiam.datasets.images import read_deep

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
CLIP, TRUTH = (ROOT / "examples" / f"shaky-walker.{end}" for end in ("mp4", "txt"))
SHAKES = {
    "walker": None,
    "gusts": Shake(0.03, "gusts"),
    "vibration": Shake(0.02, "vibration"),
    "handheld": Shake(0.06, "handheld"),
}
TRACKER = "csrt"
PHOTOS, PLOTS = ("fig1", "fig5", "fig6"), ("fig3", "fig4")
WIDTH = 1400  # px, at most
JPEG_QUALITY = 82


def write_sequences(folder: Path) -> None:
    """Write the sequences in OTB's layout, whose boxes count from 1."""
    raw = VideoSequence("walker", CLIP, np.loadtxt(TRUTH, delimiter=","))
    for name, shake in SHAKES.items():
        sequence = raw if shake is None else shaken(raw, shake)
        images = folder / name / "img"
        images.mkdir(parents=True)
        for number, image in enumerate(sequence.images(), 1):
            cv2.imwrite(str(images / f"{number:04}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        boxes = sequence.truth + np.array([1, 1, 0, 0])
        np.savetxt(folder / name / "groundtruth_rect.txt", boxes, fmt="%.2f", delimiter=",")


def copy_photo(source: Path, target: Path) -> None:
    """Write an image as JPEG, at most `WIDTH` pixels wide."""
    image = read_deep(source)
    scale = min(1.0, WIDTH / image.shape[1])
    image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(target), image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])


def make(folder: Path) -> None:
    """Run the trackers and copy the figures into the documentation."""
    data, runs, page = folder / "walkers", folder / "runs", folder / "page"
    if not data.exists():
        write_sequences(data)
    for protocol in ("vot", "ope"):
        arguments = ["--trackers", TRACKER, "--stabilize", "off,paper", "--protocol", protocol]
        assert ssiam(["bench", str(data), "--out", str(runs), *arguments]) == 0
    chosen = ["--sequences", ",".join(SHAKES)]
    arguments = ["--dataset", str(data), "--out", str(page), *chosen]
    assert ssiam(["tables", str(runs), *arguments]) == 0
    for name in PHOTOS:
        copy_photo(page / f"{name}-{data.name}.png", IMAGES / f"paper-{name}.jpg")
    for name in PLOTS:
        shutil.copyfile(page / f"{name}-{data.name}.png", IMAGES / f"paper-{name}.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, add_help=True)
    parser.add_argument("--keep", type=Path, help="folder of the runs, which continue from it")
    kept = parser.parse_args().keep
    if kept is not None:
        make(kept)
    else:
        with tempfile.TemporaryDirectory() as temporary:
            make(Path(temporary))
