"""Table 2 of the paper: the five keypoint generators, and direct alignment.

    python benchmarks/motion/generators.py [--frames 60]

Time and error c of the camera motion on the drawn scenes of benchmarks/motion/compare.py (640x360,
one thread, similarity), and the mean success of NanoTrack v2 with `stabilize="paper"` over the real
sequences (one pass, up to 200 frames), unshaken and shaken by 3 % of the width and 1 degree of
roll. Needs the folder of test data (see benchmarks/common/data.py).
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
from benchmarks.common.data import sequences
from benchmarks.common.loading import load
from benchmarks.motion.clips import Clip, corner_distances, drawn_clips, shaken

MAX_FRAMES = 200  # of a sequence
SHAKE = "3 %"


def motion_of(keypoints: KeypointName, clips: Sequence[Clip]) -> tuple[float, list[float]]:
    """Median milliseconds per frame, and c of each clip in pixels."""
    milliseconds, errors = [], []
    for clip in clips:
        camera, found = ssiam.CameraMotion(keypoints), []
        for index, frame in enumerate(clip.frames):
            start = time.perf_counter()
            motion = camera.update(frame, exclude=clip.boxes[max(index - 1, 0)])
            milliseconds.append(1e3 * (time.perf_counter() - start))
            found.append(motion.cur_from_prev)
        height, width = clip.frames.shape[1:3]
        assert clip.cur_from_prev is not None
        distances = corner_distances(np.stack(found), clip.cur_from_prev, (width, height))
        errors.append(float(np.sqrt(np.mean(distances[3:] ** 2))))
    return float(np.median(milliseconds)), errors


def mean_success(config: ssiam.StabilizerConfig | str, clips: Sequence[Clip]) -> float:
    """Mean success of NanoTrack v2."""
    tracker = load("nanotrack_v2", config)
    values = []
    for clip in clips:
        tracker.init(clip.frames[0], clip.boxes[0].tolist())
        found = [clip.boxes[0], *(tracker.update(frame).box for frame in clip.frames[1:])]
        values.append(success(found, clip.boxes).auc)
    return float(np.mean(values))


def unshaken_clips() -> list[Clip]:
    """The real sequences."""
    clips = []
    for name, sequence in sequences().items():
        frames = np.stack(list(islice(sequence.images(), MAX_FRAMES)))
        boxes = np.array([sequence.box(index) for index in range(len(frames))])
        clips.append(Clip("real", "unshaken", name, frames, boxes))
    return clips


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60, help="of a drawn scene")
    cv2.setNumThreads(1)
    drawn = list(drawn_clips([(640, 360)], parser.parse_args().frames, 1, []))
    unshaken = unshaken_clips()
    shaking = [shaken(clip, SHAKE) for clip in unshaken]
    scenes = " / ".join(clip.scene for clip in drawn)
    print(f"| keypoints | ms | c, px: {scenes} | success | success, shaken |\n" + "|---" * 5 + "|")
    off = [mean_success("off", clips) for clips in (unshaken, shaking)]
    print(f"| not stabilized | | | {off[0]:.3f} | {off[1]:.3f} |", flush=True)
    for keypoints in KEYPOINTS:
        milliseconds, errors = motion_of(keypoints, drawn)
        config = ssiam.StabilizerConfig(keypoints=keypoints)
        values = [mean_success(config, clips) for clips in (unshaken, shaking)]
        cell = " / ".join(f"{error:.2f}" for error in errors)
        print(
            f"| {keypoints} | {milliseconds:.1f} | {cell} | {values[0]:.3f} | {values[1]:.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
