"""Table 2 of the paper: the five keypoint generators, and direct alignment beside them.

    python benchmarks/motion/generators.py [--frames 60]

Time and error c of the camera motion on the drawn scenes of benchmarks/motion/compare.py (640x360, one
thread, similarity), and the mean success of NanoTrack v2 with `stabilize="paper"` over the real
sequences (one pass, up to 200 frames, nothing added), and over the same ones under shake: shifts
of 3 % of the width and 1 degree of roll. Needs the folder of test data (see shared_data.py).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

import ssiam
from ssiam.evaluation.measures.success import success
from ssiam.motion import KEYPOINTS, KeypointName

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.common.data import WEIGHTS, sequences
from benchmarks.motion.clips import Clip, corner_distances, drawn_clips, shaken

LONGEST = 200
SHAKE = "3 %"


def motion_of(keypoints: KeypointName, clips: Sequence[Clip]) -> tuple[float, list[float]]:
    """Median milliseconds of a frame, and c of each clip."""
    took, errors = [], []
    for clip in clips:
        camera, found = ssiam.CameraMotion(keypoints), []
        for index, frame in enumerate(clip.frames):
            start = time.perf_counter()
            motion = camera.update(frame, exclude=clip.boxes[max(index - 1, 0)])
            took.append(1e3 * (time.perf_counter() - start))
            found.append(motion.cur_from_prev)
        height, width = clip.frames.shape[1:3]
        distances = corner_distances(np.stack(found), clip.cur_from_prev, (width, height))
        errors.append(float(np.sqrt(np.mean(distances[3:] ** 2))))
    return float(np.median(took)), errors


def tracked(config: ssiam.StabilizerConfig | str, clips: Sequence[Clip]) -> float:
    """Mean success of NanoTrack v2."""
    tracker = ssiam.load_tracker(
        "nanotrack_v2", weights=WEIGHTS / "nanotrackv2", stabilize=config, threads=1
    )
    values = []
    for clip in clips:
        tracker.init(clip.frames[0], clip.boxes[0])
        found = [clip.boxes[0]] + [tracker.update(frame).box for frame in clip.frames[1:]]
        values.append(success(found, clip.boxes).auc)
    return float(np.mean(values))


def real() -> list[Clip]:
    """The sequences, as they are."""
    clips = []
    for name, sequence in sequences().items():
        frames = np.stack(list(islice(sequence.images(), LONGEST)))
        boxes = np.array([sequence.box(index) for index in range(len(frames))])
        clips.append(Clip("real", "unshaken", name, frames, boxes))
    return clips


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    cv2.setNumThreads(1)
    drawn = list(drawn_clips([(640, 360)], parser.parse_args().frames, 1, []))
    plain = real()
    shaking = [shaken(clip, SHAKE) for clip in plain]
    scenes = " / ".join(clip.scene for clip in drawn)
    print(f"| keypoints | ms | c, px: {scenes} | success | success, shaken |\n" + "|---" * 5 + "|")
    off = [tracked("off", clips) for clips in (plain, shaking)]
    print(f"| not steadied | | | {off[0]:.3f} | {off[1]:.3f} |", flush=True)
    for keypoints in KEYPOINTS:
        took, errors = motion_of(keypoints, drawn)
        config = ssiam.StabilizerConfig(keypoints=keypoints)
        values = [tracked(config, clips) for clips in (plain, shaking)]
        told = " / ".join(f"{error:.2f}" for error in errors)
        print(
            f"| {keypoints} | {took:.1f} | {told} | {values[0]:.3f} | {values[1]:.3f} |", flush=True
        )


if __name__ == "__main__":
    main()
