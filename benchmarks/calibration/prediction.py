"""Limits of predictions: turn of the view, speed of a target in doubt, error at the start.

    python benchmarks/calibration/prediction.py [--davis DAVIS] [--sets FOLDER ...] [--frames 50]
        [--trackers lite] [--max-turn 0.1 ...] [--speed-loss 0.1 ...] [--untested-error 0.3 ...]

Mean overlap with predict, in one pass over the first frames, on videos that report nothing.

The sets are folders that `ssiam bench` reads, with a target in every sequence or track: as they
are, with hand-held and white shake of 3 % and roll of 5 %, and with the target hidden behind what
is beside it for 6 and for 12 frames. The default is ADL-Rundle-6 of the folder of test
data. Frames wider than 914 pixels are reduced to 640.

DAVIS is the folder of JPEGImages and Annotations (480p). Its videos (`--videos`, by default the ten
that lite was not trained on) are turned by a degree in each frame: "spin" is the whole frame,
"orbit" the scene behind a target that stays upright, as in the footage of a camera that circles it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from itertools import islice, product
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np

import ssiam
from ssiam.datasets import Shake, VideoSequence, open_dataset, shaken
from ssiam.evaluation.measures.regions import upright
from ssiam.geometry import Image, iou
from ssiam.stabilize import predictor

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks.accuracy.masks import HELD_OUT, box, true_mask
from benchmarks.common.data import MOT, read_bgr
from benchmarks.common.loading import load
from benchmarks.common.tables import line
from benchmarks.lost.clips import Floats

TURNS = ("spin", "orbit")
SHAKES = (Shake(0.0), Shake(0.03, "handheld"), Shake(0.03, "white"), Shake(0.05, "roll"))
HIDDEN = (6, 12)  # frames
HIDDEN_FROM = 20  # frame
WIDEST, WIDTH = 914, 640  # px
MIN_AREA = 64  # px, of a target in the first frame
RIM = 4  # px around a target that the scene behind it must not show

Clip = tuple[list[Image], Floats]  # frames, and boxes (N, 4) x, y, w, h; NaN where not visible


def mean_overlap(tracker: ssiam.StabilizedTracker, clip: Clip) -> float:
    """Mean IoU in the frames after the first one."""
    frames, truth = clip
    tracker.init(frames[0], truth[0].tolist())
    boxes = np.array([tracker.update(frame).box for frame in frames[1:]])
    return float(np.nanmean(iou(boxes, truth[1:])))


def davis_clip(root: Path, video: str, count: int) -> tuple[list[Image], list[Image]]:
    """Frames, and masks (H, W) uint8 of 0 and 1."""
    frames = sorted((root / "JPEGImages" / "480p" / video).glob("*.jpg"))[:count]
    masks = sorted((root / "Annotations" / "480p" / video).glob("*.png"))[:count]
    return [read_bgr(path) for path in frames], [true_mask(path).astype(np.uint8) for path in masks]


def turned(frames: list[Image], masks: list[Image], kind: str) -> Clip:
    """The frames, of which each is turned by a degree more than the one before it."""
    height, width = frames[0].shape[:2]
    size, middle = (width, height), (width / 2, height / 2)
    found, boxes = [], []
    for index, (frame, mask) in enumerate(zip(frames, masks, strict=True)):
        turn = cv2.getRotationMatrix2D(middle, index, 1.0)
        scene, move = frame, turn
        if kind == "orbit":
            x, y, w, h = box(mask.astype(np.bool_))
            center = np.array([x + w / 2, y + h / 2])
            scene, move = without(frame, mask), np.eye(2, 3)
            move[:, 2] = turn @ [*center, 1] - center
        image = cv2.warpAffine(scene, turn, size, borderMode=cv2.BORDER_REFLECT)
        moved_mask = cv2.warpAffine(mask, move, size, flags=cv2.INTER_NEAREST)
        if kind == "orbit":
            moved = cv2.warpAffine(frame, move, size, borderMode=cv2.BORDER_REFLECT)
            image = np.where(moved_mask[..., None] > 0, moved, image)
        found.append(np.asarray(image, np.uint8))
        boxes.append(box(moved_mask > 0) if moved_mask.any() else (np.nan,) * 4)
    return found, np.array(boxes)


def without(frame: Image, mask: Image) -> Image:
    """The frame with its target filled from what is around it."""
    small = cv2.resize(frame, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    hidden = cv2.dilate(mask, np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8))
    small_hidden = cv2.resize(hidden, small.shape[1::-1], interpolation=cv2.INTER_AREA)
    filled = cv2.inpaint(small, small_hidden, 3, cv2.INPAINT_TELEA)
    filled = cv2.resize(filled, frame.shape[1::-1])
    return np.asarray(np.where(hidden[..., None] > 0, filled, frame), np.uint8)


def set_clip(sequence: VideoSequence, shake: Shake, count: int) -> Clip | None:
    """The first frames of a shaken sequence; None if the target is too small."""
    seen = shaken(sequence, shake)
    truth = upright(seen.truth)[:count]
    if not np.isfinite(truth[0]).all() or truth[0, 2] * truth[0, 3] < MIN_AREA:
        return None
    frames = list(islice(seen.images(), len(truth)))
    if frames[0].shape[1] > WIDEST:
        zoom = WIDTH / frames[0].shape[1]
        frames = [
            np.asarray(cv2.resize(each, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA))
            for each in frames
        ]
        truth = truth * zoom
    return frames, truth


def hidden(clip: Clip, count: int) -> Clip:
    """The clip with the target hidden, for `count` frames, behind what is beside it."""
    frames, truth = list(clip[0]), clip[1]
    for index in range(HIDDEN_FROM, min(HIDDEN_FROM + count, len(frames))):
        x, y, w, h = truth[index]
        if not np.isfinite(truth[index]).all():
            continue
        height, width = frames[index].shape[:2]
        left, right = max(round(x - 0.15 * w), 0), min(round(x + 1.15 * w), width)
        top, bottom = max(round(y - 0.15 * h), 0), min(round(y + 1.15 * h), height)
        side = right - left
        if side <= 0 or bottom <= top:
            continue
        source = left - side if left >= side else min(right, width - side)
        image = frames[index].copy()
        image[top:bottom, left:right] = frames[index][top:bottom, source : source + side]
        frames[index] = image
    return frames, truth


def turn_columns(
    tracker: ssiam.StabilizedTracker, davis: Path, videos: list[str], count: int
) -> Iterator[float]:
    """Mean overlap in the videos with each turn."""
    for kind in TURNS:
        clips = (turned(*davis_clip(davis, video, count), kind) for video in videos)
        yield float(np.mean([mean_overlap(tracker, clip) for clip in clips]))


def set_columns(tracker: ssiam.StabilizedTracker, folder: Path, count: int) -> Iterator[float]:
    """Mean overlap in a set with each shake, then with hidden targets."""
    sequences = list(open_dataset(folder).sequences.values())
    for shake, frames_hidden in (
        *((each, 0) for each in SHAKES),
        *((SHAKES[0], n) for n in HIDDEN),
    ):
        clips = (set_clip(each, shake, count) for each in sequences)
        found = [mean_overlap(tracker, hidden(clip, frames_hidden)) for clip in clips if clip]
        yield float(np.mean(found))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--davis", type=Path)
    parser.add_argument("--videos", nargs="+", default=HELD_OUT.split(","))
    parser.add_argument("--sets", type=Path, nargs="+", default=[MOT / "ADL-Rundle-6"])
    parser.add_argument("--frames", type=int, default=50)
    parser.add_argument("--trackers", nargs="+", default=["lite"])
    parser.add_argument("--max-turn", type=float, nargs="+", default=[0.1])
    parser.add_argument("--speed-loss", type=float, nargs="+", default=[0.1])
    parser.add_argument("--untested-error", type=float, nargs="+", default=[0.3])
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    names = ["as they are", *(f"{shake.kind} {shake.strength:g}" for shake in SHAKES[1:])]
    names += [f"hidden {count}" for count in HIDDEN]
    names = [f"{folder.name}, {name}" for folder in chosen.sets for name in names]
    names += TURNS if chosen.davis else ()
    print(line(("tracker", "max turn", "speed loss", "untested error", *names)))
    print("|---" * (4 + len(names)) + "|")
    values = product(chosen.trackers, chosen.max_turn, chosen.speed_loss, chosen.untested_error)
    for name, max_turn, speed_loss, untested_error in values:
        tracker = load(name, ssiam.StabilizerConfig("predict"))
        found: list[float] = []
        with (
            patch.object(predictor, "_MAX_TURN", max_turn),
            patch.object(predictor, "_SPEED_LOSS", speed_loss),
            patch.object(predictor, "_UNTESTED_ERROR", untested_error),
        ):
            for folder in chosen.sets:
                found += set_columns(tracker, folder, chosen.frames)
            if chosen.davis:
                found += turn_columns(tracker, chosen.davis, chosen.videos, chosen.frames)
        cells = (f"{max_turn:g}", f"{speed_loss:g}", f"{untested_error:g}")
        print(line((name, *cells, *(f"{value:.4f}" for value in found))), flush=True)


if __name__ == "__main__":
    main()
