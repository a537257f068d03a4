"""Background error at the target where the camera flies past things: with and without a mesh.

    python benchmarks/motion/parallax.py [--frames 60] [--chosen] [--models similarity mesh]

The clips are those of the test data whose camera moves through the scene (drones, vehicles,
runners) and, as a check, those whose camera only turns. The motion of the background around the
target has no ground truth; here it is the median of Lucas-Kanade flow, checked forward and
backward, of corners in a ring around the target, which has nothing in common with direct alignment.
The error of a frame is the distance between the median flow and `Motion.at` the target's center, in
% of the width. Frames with fewer than eight corners, or with flow that disagrees with itself (a
spread of more than .5 %), are left out, and frames in which a model is not reliable.

The mesh's numbers were chosen on the clips of `--chosen`: the two videos and ADL-Rundle-6, with
three boxes that stand still in the frame. Needs the folder of test data (see
benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import MOT, RESERVE, VIDEOS, read_bgr, sequences
from benchmarks.common.tables import head, line
from ssiam import CameraMotion
from ssiam.datasets.mot import clip_folders, read_clip
from ssiam.geometry import Image, map_points
from ssiam.motion import CameraModelName
from ssiam.video import open_source

THROUGH = (
    *("Car1", "MotorRolling", "RedTeam", "Skiing", "Suv", "Surfer"),
    *("dtb70_MountainBike6", "uav123_wakeboard7"),
)
TURNING = ("Bolt2", "Couple", "Jumping", "Girl")
BAD = 0.5  # % of the width
MIN_CORNERS = 8
RING = 1.2, 3.0  # sides of the target: inner and outer edge of the ring
MAX_CORNERS = 60
BACKWARD = 0.5  # px by which forward and backward flow may differ
FIXED = ((0.15, 0.4), (0.45, 0.4), (0.7, 0.6))  # corners of boxes, shares of the frame
FIXED_SIDE = 0.12  # of the width

Floats = NDArray[np.float64]
Clip = tuple[str, list[Image], list[list[Floats]]]  # name, frames, boxes of each target by frame


def clips(count: int) -> Iterator[Clip]:
    """The clips that report."""
    found = dict(sequences()) | dict(sequences(RESERVE))
    for name in (*THROUGH, *TURNING):
        images = list(islice(found[name].images(), count))
        boxes = [np.asarray(found[name].box(index), np.float64) for index in range(len(images))]
        yield name, images, [boxes]


def chosen_clips(count: int) -> Iterator[Clip]:
    """The clips that chose the numbers of the mesh."""
    for path in sorted(VIDEOS.iterdir()):
        with open_source(path) as source:
            images = [frame.image for frame in islice(source, count)]
        yield path.name, images, fixed_boxes(images)
    for folder in clip_folders(MOT):
        if folder.name == "ADL-Rundle-6":
            images = [read_bgr(path) for path in read_clip(folder).paths(0)[:count]]
            yield folder.name, images, fixed_boxes(images)


def fixed_boxes(images: Sequence[Image]) -> list[list[Floats]]:
    """Boxes that stand still in the frame."""
    height, width = images[0].shape[:2]
    side = FIXED_SIDE * width
    targets = [np.array([x * width, y * height, side, side]) for x, y in FIXED]
    return [[box] * len(images) for box in targets]


def ring_flow(prev: Image, cur: Image, box: Floats) -> tuple[Floats, Floats] | None:
    """Corners (N, 2) around the box in the previous frame, and where they are now."""
    mask = np.zeros(prev.shape[:2], np.uint8)
    for share, value in zip(reversed(RING), (255, 0), strict=True):
        low = np.maximum(box[:2] - (share - 1) / 2 * box[2:], 0).astype(int)
        high = np.maximum(box[:2] + (share + 1) / 2 * box[2:], 0).astype(int)
        mask[low[1] : high[1], low[0] : high[0]] = value
    corners = cv2.goodFeaturesToTrack(prev, MAX_CORNERS, 0.01, 5, mask=mask)
    if corners is None:
        return None
    guess = np.empty_like(corners)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(prev, cur, corners, guess, maxLevel=4)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(cur, prev, moved, guess.copy(), maxLevel=4)
    same = np.linalg.norm(back - corners, axis=2).ravel() < BACKWARD
    good = same & (found.ravel() > 0) & (returned.ravel() > 0)
    return corners[good, 0].astype(np.float64), moved[good, 0].astype(np.float64)


def errors(
    images: Sequence[Image], boxes: Sequence[Floats], models: Sequence[CameraModelName]
) -> Floats:
    """Errors (frames, models) in % of the width, of the frames in which all can be compared."""
    cameras = [CameraMotion(model=model) for model in models]
    for camera in cameras:
        camera.update(images[0])
    grays = [np.asarray(cv2.cvtColor(each, cv2.COLOR_BGR2GRAY), np.uint8) for each in images]
    width, rows = images[0].shape[1], []
    for index in range(1, len(images)):
        box = boxes[index - 1]
        motions = [camera.update(images[index], box.tolist()) for camera in cameras]
        flow = ring_flow(grays[index - 1], grays[index], box)
        if flow is None or len(flow[0]) < MIN_CORNERS or not all(m.reliable for m in motions):
            continue
        x, y = (box[:2] + box[2:] / 2).tolist()
        missed = [flow[1] - map_points(motion.at((x, y)), flow[0]) for motion in motions]
        middle = np.median(missed, axis=1)
        spread = np.median(np.linalg.norm(missed[0] - middle[0], axis=1))
        if spread <= BAD / 100 * width:
            rows.append(100 / width * np.linalg.norm(middle, axis=1))
    return np.array(rows).reshape(-1, len(models))


def main() -> None:
    """Print a row for each clip, and the sums."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--chosen", action="store_true", help="the clips that chose the numbers")
    parser.add_argument("--models", nargs="+", default=["similarity", "mesh"])
    options = parser.parse_args()
    cv2.setNumThreads(1)
    models = options.models
    cells = [f"{model}: {what}" for model in models for what in ("median", f"beyond {BAD} %")]
    print(head(["clip", "frames", *cells]), flush=True)
    groups: dict[str, list[Floats]] = {}
    for name, images, targets in (chosen_clips if options.chosen else clips)(options.frames):
        found = np.concatenate([errors(images, boxes, models) for boxes in targets])
        print(row(name, found), flush=True)
        groups.setdefault("turning" if name in TURNING else "moving through", []).append(found)
    for group, parts in groups.items():
        print(row(f"all, {group}", np.concatenate(parts)))


def row(name: str, found: Floats) -> str:
    """A line of the table."""
    if not len(found):
        return line([name, 0])
    values = [
        f"{value}"
        for column in found.T
        for value in (f"{np.median(column):.3f} %", int((column > BAD).sum()))
    ]
    return line([name, len(found), *values])


if __name__ == "__main__":
    main()
