"""What the trackers recorded on a clip: boxes and motions, kept in files for many virtual cameras.

A clip is a shaken sequence with the true box of each frame, or a real video with some annotated
boxes. lite with "predict", CSRT alone, and CSRT on the frames that vidstab has stabilized are run
once; later calls read the file. vidstab is installed with OpenCV 4 into its own environment; its
estimates are those of `VidStab`, and its smoothing, a trailing mean of 30 frames, is repeated here.
"""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.data import RESERVE, SEQUENCES, VIDEOS, sequences
from benchmarks.common.loading import load
from benchmarks.motion.peers import Worker
from benchmarks.shake.measure import unshaken_motions
from ssiam.datasets import Shake, shaken
from ssiam.datasets.shake.path import ShakeKind
from ssiam.evaluation.measures.regions import upright
from ssiam.geometry import Image, Transform, map_box, rigid_parameters
from ssiam.motion import Motion
from ssiam.video import open_source

ANNOTATIONS = Path(__file__).with_name("boxes.csv")
FOLDERS = {"sequences": SEQUENCES, "reserve": RESERVE}
SMOOTHING = 30  # frames: the default smoothing_window of vidstab
RATE = 30.0  # frames per second

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames with the true boxes of some of them.

    Attributes
    ----------
    name : str
    frames : list of (H, W, 3) uint8 BGR
    truth : (N, 4) float64
        Pixels; nan where it is unknown.
    true_motion : (N, 3, 3) float64 or None
        cur_from_prev of each frame, if it is known.
    """

    name: str
    frames: list[Image]
    truth: Floats
    true_motion: Transform | None


@dataclass(frozen=True, eq=False)
class Recording:
    """What was recorded on a clip of N frames.

    Attributes
    ----------
    size_wh : (2,) int
        Pixels.
    truth : (N, 4) float64
        Pixels; nan where it is unknown.
    box, csrt : (N, 4) float64
        Of lite with "predict", and of CSRT alone.
    vidstab_csrt : (N, 4) float64
        Of CSRT on the frames stabilized by vidstab, in the raw frames.
    lost : (N,) bool
        Frames in which lite was lost.
    motion : (N, 3, 3) float64
        cur_from_prev as lite with "predict" used it.
    reliable : (N,) bool
    true_motion : (N, 3, 3) float64
        cur_from_prev; that of lite where it is unknown.
    stab_from_raw : (N, 3, 3) float64
        Of vidstab.
    """

    size_wh: NDArray[np.int64]
    truth: Floats
    box: Floats
    csrt: Floats
    vidstab_csrt: Floats
    lost: NDArray[np.bool_]
    motion: Transform
    reliable: NDArray[np.bool_]
    true_motion: Transform
    stab_from_raw: Transform

    @property
    def motions(self) -> list[Motion]:
        """The recorded motions."""
        width, height = self.size_wh.tolist()
        return [
            Motion(each, 1.0, bool(reliable), (width, height))
            for each, reliable in zip(self.motion, self.reliable, strict=True)
        ]

    @property
    def boxes(self) -> list[tuple[float, float, float, float] | None]:
        """The boxes of lite; None in frames in which it was lost."""
        return [
            None if lost else (box[0], box[1], box[2], box[3])
            for box, lost in zip(self.box.tolist(), self.lost, strict=True)
        ]


def sequence_names(folder: Path = SEQUENCES) -> list[str]:
    """Names of the sequences in a folder."""
    return list(sequences(folder))


def sequence_clip(folder: Path, name: str, kind: ShakeKind, strength: float, seed: int) -> Clip:
    """A sequence of a folder, shaken; its true motion is the shake and the sequence's motion."""
    unshaken = sequences(folder)[name]
    sequence = shaken(unshaken, Shake(strength, kind, seed))
    shake, raw_motion = sequence.shaken_from_raw, unshaken_motions(unshaken)
    motion = shake[1:] @ raw_motion[1:] @ np.linalg.inv(shake[:-1])
    return Clip(
        name,
        list(sequence.images()),
        upright(sequence.truth),
        np.concatenate([np.eye(3)[None], motion]),
    )


def annotated_videos() -> list[str]:
    """Names of the videos in boxes.csv."""
    with ANNOTATIONS.open() as rows:
        return list(dict.fromkeys(row["video"] for row in csv.DictReader(rows)))


def video_clip(name: str) -> Clip:
    """A video with its annotated boxes; it begins with the first annotated frame."""
    with ANNOTATIONS.open() as rows:
        found = [row for row in csv.DictReader(rows) if row["video"] == name]
    boxes = {int(row["frame"]): [float(row[key]) for key in "xywh"] for row in found}
    with open_source(VIDEOS / name) as source:
        frames = [frame.image for frame in source]
    truth = np.full((len(frames), 4), np.nan)
    for index, box in boxes.items():
        truth[index] = box
    first = min(boxes)
    return Clip(name, frames[first:], truth[first:], None)


def recorded(make: Callable[[], Clip], path: Path, environments: Path) -> Recording:
    """The recording in `path`; if there is none, that of the clip that `make` returns, kept there.

    `environments` is the folder of the virtual environments of the peers.
    """
    names = [field.name for field in fields(Recording)]
    if not path.exists():
        recording = _record(make(), environments)
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **{name: getattr(recording, name) for name in names})
    with np.load(path) as arrays:
        return Recording(**{name: arrays[name] for name in names})


def _record(clip: Clip, environments: Path) -> Recording:
    cv2.setNumThreads(1)
    height, width = clip.frames[0].shape[:2]
    tracker = load("lite", "predict")
    first: list[float] = clip.truth[0].tolist()
    tracker.init(clip.frames[0], first)
    boxes, lost, motions = [first], [False], [Motion.none((width, height), reliable=True)]
    for frame in clip.frames[1:]:
        track = tracker.update(frame)
        assert track.motion is not None
        boxes.append(list(track.box))
        lost.append(track.lost)
        motions.append(track.motion)
    motion = np.stack([each.cur_from_prev for each in motions])
    stab_from_raw = _vidstab(clip.frames, environments)
    stabilized = (
        cv2.warpAffine(frame, matrix[:2], (width, height))
        for frame, matrix in zip(clip.frames, stab_from_raw, strict=True)
    )
    stab_boxes = _csrt(stabilized, map_box(stab_from_raw[0], first))
    return Recording(
        np.array([width, height]),
        clip.truth,
        np.array(boxes),
        _csrt(iter(clip.frames), first),
        np.array(
            [
                map_box(np.linalg.inv(matrix), box)
                for matrix, box in zip(stab_from_raw, stab_boxes.tolist(), strict=True)
            ]
        ),
        np.array(lost),
        motion,
        np.array([each.reliable for each in motions]),
        motion if clip.true_motion is None else clip.true_motion,
        stab_from_raw,
    )


def _csrt(frames: Iterator[Any], box: Sequence[float]) -> Floats:
    """Boxes (N, 4) of CSRT without stabilization."""
    tracker = load("csrt", "off")
    tracker.init(np.asarray(next(frames), np.uint8), list(box))
    return np.array([box, *(tracker.update(np.asarray(each, np.uint8)).box for each in frames)])


def _vidstab(frames: list[Image], environments: Path) -> Transform:
    """stab_from_raw (N, 3, 3) of vidstab: its estimates, and their trailing mean."""
    with tempfile.TemporaryDirectory() as folder, Worker("vidstab-gftt", environments) as worker:
        path = Path(folder) / "clip.npz"
        np.savez(path, frames=np.stack(frames), boxes=np.zeros((len(frames), 4)))
        motion = worker.run(path, exclude=False).cur_from_prev
    steps = np.array([rigid_parameters(each, (0.0, 0.0)) for each in motion[1:]])
    path_of_frames = np.cumsum(steps, axis=0)
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), path_of_frames]), axis=0)
    mean = (sums[SMOOTHING:] - sums[:-SMOOTHING]) / SMOOTHING
    smooth = np.vstack([np.tile(mean[:1], (SMOOTHING - 1, 1)), mean])
    # VidStab moves frame i by the step to frame i + 1, and by what smoothing has changed there
    moves = steps + smooth - path_of_frames
    return np.stack([_at_origin(*move) for move in [*moves, moves[-1]]])


def _at_origin(dx: float, dy: float, angle: float) -> Transform:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, dx], [sin, cos, dy], [0, 0, 1]])
