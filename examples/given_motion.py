"""Track with a motion that is measured, by a gimbal or a gyroscope, not estimated from the image.

    python given_motion.py shaky-walker.mp4 53,114,26,66 shaky-walker-motion.csv

The CSV file has dx, dy (pixels) and angle (radians, clockwise): how the image is displaced in each
frame. For the rates of a gyroscope see ssiam.Motion.from_rotation.
"""

import csv
import sys
from pathlib import Path

import numpy as np

import ssiam
from ssiam.geometry import rigid
from ssiam.video import open_source


def main(source: str, box: str, log: str) -> None:
    """Print the box of the target in each frame."""
    rows = list(csv.DictReader(Path(log).read_text(encoding="utf-8").splitlines()))
    tracker = ssiam.load_tracker()
    with open_source(source) as frames:
        tracker.init(next(frames).image, [float(number) for number in box.split(",")])
        width, height = frames.size_wh
        center_xy = (width - 1) / 2, (height - 1) / 2
        poses = [
            rigid(float(row["dx"]), float(row["dy"]), float(row["angle"]), center_xy)
            for row in rows
        ]
        for frame, before, now in zip(frames, poses, poses[1:], strict=False):
            motion = ssiam.Motion.from_transform(now @ np.linalg.inv(before), frames.size_wh)
            print(frame.index, tracker.update(frame.image, motion=motion))


if __name__ == "__main__":
    main(*sys.argv[1:])
