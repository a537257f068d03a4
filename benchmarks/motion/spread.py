"""Evenly spread keypoints: the error of the camera motion with `spread` on and off.

    python benchmarks/motion/spread.py [--frames 40] [--keypoints orb gftt] [--fits robust ...]

Drawn scenes (640x360): the root mean square error c as in benchmarks/motion/compare.py, pixels.
Real sequences shaken by 3 % of the width with 1 degree of roll: the median error, % of the width,
and the share of frames with an error of more than 1 %. The target's box is excluded, unless a
column says "no box": then many keypoints may be on the target. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from copy import copy
from itertools import islice, product
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import ssiam
from ssiam.errors import check_choice
from ssiam.motion import FitName
from ssiam.motion.camera import KEYPOINTS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import sequences
from benchmarks.common.tables import head, line
from benchmarks.motion.clips import REAL, UNSHAKEN, Clip, drawn_clips, shaken

SHAKE = "3 %"
LARGE = 1.0  # % of the width
FITS: tuple[FitName, ...] = ("robust", "least_squares")


def estimates(camera: ssiam.CameraMotion, clip: Clip, exclude: bool) -> NDArray[np.float64]:
    """The motion to every frame, (N, 3, 3)."""
    boxes = [None, *(box.tolist() for box in clip.boxes[:-1])]
    motions = [
        camera.update(frame, box if exclude else None)
        for frame, box in zip(clip.frames, boxes, strict=True)
    ]
    return np.stack([motion.cur_from_prev for motion in motions])


def drawn_errors(clips: Sequence[Clip], camera: ssiam.CameraMotion) -> list[float]:
    """The error c of each drawn scene, pixels."""
    distances = [clip.errors(estimates(camera_like(camera), clip, True), None) for clip in clips]
    return [float(np.sqrt(np.mean(each**2))) for each in distances]


def real_error(
    clips: Sequence[tuple[Clip, Clip]], camera: ssiam.CameraMotion, exclude: bool
) -> tuple[float, float]:
    """Median error (% of the width) and share of large errors over all frames."""
    errors = []
    for unshaken, shaking in clips:
        still = estimates(camera_like(camera), unshaken, exclude)
        errors.append(shaking.errors(estimates(camera_like(camera), shaking, exclude), still))
    every = np.concatenate(errors)
    return float(np.median(every)), float((every > LARGE).mean())


def camera_like(camera: ssiam.CameraMotion) -> ssiam.CameraMotion:
    """A new estimator with the settings of `camera`, which has no frame yet."""
    return copy(camera)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=40, help="of a clip, at most")
    parser.add_argument("--keypoints", nargs="+", default=["orb"], choices=KEYPOINTS[1:])
    parser.add_argument("--fits", nargs="+", default=FITS, choices=FITS)
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    drawn = list(drawn_clips([(640, 360)], chosen.frames, 1, []))
    real = []
    for name, sequence in sequences().items():
        frames = np.stack(list(islice(sequence.images(), chosen.frames)))
        boxes = np.array([sequence.box(index) for index in range(len(frames))])
        unshaken = Clip(REAL, UNSHAKEN, name, frames, boxes)
        real.append((unshaken, shaken(unshaken, SHAKE)))
    scenes = " / ".join(clip.scene for clip in drawn)
    columns = ("keypoints", "fit", "spread", f"c: {scenes}", "median", "no box", "> 1 %", "no box")
    print(head(columns))
    for name, fit, spread in product(chosen.keypoints, chosen.fits, (True, False)):
        keypoints = check_choice("keypoints", name, KEYPOINTS)
        camera = ssiam.CameraMotion(keypoints, check_choice("fit", fit, FITS), spread=spread)
        on_real = [real_error(real, camera, exclude) for exclude in (True, False)]
        cells = [
            *(name, fit, "on" if spread else "off"),
            " / ".join(f"{error:.2f}" for error in drawn_errors(drawn, camera)) + " px",
            *(f"{median:.3f} %" for median, _ in on_real),
            *(f"{100 * share:.1f} %" for _, share in on_real),
        ]
        print(line(cells), flush=True)


if __name__ == "__main__":
    main()
