"""What the paper leaves open: the threshold judge, the order of eq. 6, the meaning of THa.

    python benchmarks/calibration/paper_method.py --part judge
    python benchmarks/calibration/paper_method.py --part settings

"judge" prints, for every real sequence as it is and with a hand-held shake of 1 % of the width, the
root mean square distance of the camera path from the smoothed path over the window (5 %, median,
95 % of the frames), and the answer of both judges. "settings" varies THa in its four readings, the
judge and the order of eq. 6: in how many frames the view differs from that of the default (a corner
moves by more than .1 px), unshaken and under shake, and the mean overlap of NanoTrack v2 in one
pass over the five sequences with most roll under a white shake of 3 %. Needs the folder of test
data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import Shake, VideoSequence, shaken
from ssiam.evaluation.measures.success import success
from ssiam.evaluation.paper.judged import WINDOW_JUDGE, needs_stabilization
from ssiam.geometry import Image, corners_from_xywh, map_points
from ssiam.motion import CameraMotion, Motion
from ssiam.stabilize import CameraPath, PaperConfig, Stabilizer, StabilizerConfig

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import MOT, SEQUENCES, sequences
from benchmarks.common.loading import load

HANDHELD = Shake(0.01, "handheld", 0)
WHITE = Shake(0.03, "white", 0)
ROLLING = ("Couple", "David", "Jumping", "bag_vot2015", "uav123_wakeboard7")
DIFFERENT = 0.1  # px, of a corner
PAPER = StabilizerConfig("paper")
SETTINGS = {
    "default (judge frame, nested, angle, rad, .3)": PAPER,
    "judge window": PAPER.with_options(judge="window"),
    "exclusive cases of eq. 6": PAPER.with_options(limits="exclusive"),
    **{
        f"THa of the {of}, {value} {unit}": PAPER.with_options(
            tha=value, tha_limits=of, tha_unit=unit
        )
        for of in ("angle", "change")
        for unit in ("rad", "deg")
        for value in (0.1, 0.3, 0.5, 1.0)
        if (of, unit, value) != ("angle", "rad", 0.3)
    },
}


def clips() -> Iterator[tuple[str, VideoSequence]]:
    """The real sequences, and one of every multi-object clip."""
    yield from sequences(SEQUENCES).items()
    seen = set()
    for name, sequence in sequences(MOT).items():
        folder = sequence.frames[0].parent if isinstance(sequence.frames, tuple) else name
        if folder not in seen:
            seen.add(folder)
            yield name, sequence


def boxes_of(sequence: VideoSequence, count: int) -> NDArray[np.float64]:
    """Upright boxes (n, 4) of the first frames."""
    return np.array([sequence.box(index) for index in range(min(count, len(sequence)))])


def motions_of(images: list[Image], boxes: NDArray[np.float64]) -> list[Motion]:
    """The camera's motion by ORB, without the target."""
    camera, found = CameraMotion("orb"), []
    for index, image in enumerate(images):
        box = boxes[max(index - 1, 0)]
        found.append(camera.update(image, exclude=box if np.isfinite(box).all() else None))
    return found


def distances(motions: list[Motion]) -> NDArray[np.float64]:
    """Root mean square distance (n,) of the path from the smoothed path over the window, pixels."""
    path, squares = CameraPath(PaperConfig().window), []
    for motion in motions:
        if motion.reliable:
            path.advance(motion)
            dx, dy, _ = path.difference()
            squares.append(dx**2 + dy**2)
    window = PaperConfig().window
    means = [np.mean(squares[max(0, t - window + 1) : t + 1]) for t in range(len(squares))]
    return np.sqrt(means)


def print_judge(frames: int) -> None:
    """Distances and answers, by sequence."""
    print("| sequence | shake | rms distance, px: 5 %, median, 95 % | window | frame |")
    print("|---|---|---|---|---|")
    for name, raw in clips():
        for label, sequence in (("none", raw), ("1 %", shaken(raw, HANDHELD))):
            images = list(islice(sequence.images(), frames))
            motions = motions_of(images, boxes_of(sequence, frames))
            low, middle, high = np.percentile(distances(motions)[5:], [5, 50, 95])
            answers = [
                "Yes" if needs_stabilization(motions, judge) else "No"
                for judge in (WINDOW_JUDGE, PaperConfig())
            ]
            print(
                f"| {name} | {label} | {low:.2f}, {middle:.2f}, {high:.2f} "
                f"| {' | '.join(answers)} |",
                flush=True,
            )


def views(config: StabilizerConfig, motions: list[Motion]) -> list[NDArray[np.float64]]:
    """Stabilized corners of every frame."""
    stabilizer = Stabilizer(config)
    corners = corners_from_xywh((0, 0, *motions[0].size_wh))
    return [map_points(stabilizer.update(motion), corners) for motion in motions]


def differing(config: StabilizerConfig, clip_motions: list[list[Motion]]) -> str:
    """Share of the frames whose view differs from the default's."""
    found = [
        np.abs(ours - default).max() > DIFFERENT
        for motions in clip_motions
        for ours, default in zip(views(config, motions), views(PAPER, motions), strict=True)
    ]
    return f"{100 * np.mean(found):.1f} %"


def print_settings(frames: int) -> None:
    """Differing frames and success, by setting."""
    motions: dict[str, list[list[Motion]]] = {"none": [], "white": []}
    rolling = []
    for name, raw in sequences(SEQUENCES).items():
        for label, sequence in (("none", raw), ("white", shaken(raw, WHITE))):
            images, boxes = list(islice(sequence.images(), frames)), boxes_of(sequence, frames)
            motions[label].append(motions_of(images, boxes))
            if label == "white" and name in ROLLING:
                rolling.append((images, boxes, motions[label][-1]))
    print("| setting | views that differ, unshaken | shaken by 3 % | success |\n|---|---|---|---|")
    for label, config in SETTINGS.items():
        tracker, values = load("nanotrack_v2", config), []
        for images, boxes, known in rolling:
            tracker.init(images[0], boxes[0].tolist())
            tracks = [
                tracker.update(image, motion).box
                for image, motion in zip(images[1:], known[1:], strict=True)
            ]
            values.append(success([boxes[0], *tracks], boxes).auc)
        differs = " | ".join(differing(config, motions[each]) for each in ("none", "white"))
        print(f"| {label} | {differs} | {np.mean(values):.3f} |", flush=True)


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=["judge", "settings"], default="judge")
    parser.add_argument("--frames", type=int, default=120)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if arguments.part == "judge":
        print_judge(arguments.frames)
    else:
        print_settings(arguments.frames)


if __name__ == "__main__":
    main()
