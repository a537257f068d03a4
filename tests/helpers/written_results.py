"""Results as written by `ssiam track`, and hand-made rows."""

from __future__ import annotations

import numpy as np

from ssiam.geometry import rigid
from ssiam.motion import Motion
from ssiam.track import Track
from ssiam.video import open_results
from ssiam.video.results import COLUMNS

SIZE, FPS = (160, 96), 25.0
CORNERS = np.array([[0.0, 1.0], [5.0, 1.5], [4.5, 7.0], [-0.5, 6.0]])
MOTION = Motion(rigid(3.0, -2.0, 0.01, (79.5, 47.5)), 0.75, True, SIZE)
TRACKS = {
    "plain": Track((10.123, 20.0, 30.5, 40.25), score=0.9877),
    "rotated": Track((0.5, 1.0, 5.0, 6.0), score=0.5, corners=CORNERS, motion=MOTION),
    "lost": Track((1.0, 2.0, 3.0, 4.0), score=0.01, lost=True),
}
NUMBERS = ("3", "0.12", "1", "10", "20", "30", "40", "0.9", "0")
ROW = dict.fromkeys(COLUMNS, "") | dict(zip(COLUMNS, NUMBERS, strict=False))


def written(path, frames):
    with open_results(path, targets=len(frames[0])) as sink:
        for index, tracks in enumerate(frames):
            sink.write(index, index / 25, tracks)
    return path


def csv_of(*rows):
    lines = [",".join(COLUMNS), *(",".join((ROW | row).values()) for row in rows)]
    return "".join(f"{line}\n" for line in lines)
