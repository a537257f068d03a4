"""Clips whose camera motion is known: drawn scenes, and real footage shaken on purpose.

Of a drawn scene the motion itself is known. Of real footage only what was added: what an estimator
says of a shaken pair of frames must be what it says of the unshaken pair with the shake applied.
Both come from the folder of test data (see shared_data.py).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.data import SHARED, sequences
from ssiam.geometry import corners_from_xywh, frame_centre, map_box, map_points, rigid

REAL = "real"
UNSHAKEN = "unshaken"
SHAKES = ("2 %", "3 %", "5 %", "hand-held")
NO_BOX = ", no box"
_SETTLED = 3  # frames of a drawn scene that are not counted, as in bench/motion_bench.py


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames, and what is known of the camera's motion between them.

    Attributes
    ----------
    place : str
        Size of a drawn scene, such as "640x360", or "real".
    scene : str
        Name of the drawn scene, or of the shake.
    name : str
        Seed of the drawn scene, or name of the sequence.
    frames : (N, H, W, 3) uint8 BGR
    boxes : (N, 4) float64
        x, y, w, h of the target, pixels.
    exclude : bool
        Whether estimators may be told where the target is.
    cur_from_prev : (N, 3, 3) float64, optional
        True motion of a drawn scene.
    shaken_from_raw : (N, 3, 3) float64, optional
        The shake that was added to real footage.
    """

    place: str
    scene: str
    name: str
    frames: np.ndarray
    boxes: np.ndarray
    exclude: bool = True
    cur_from_prev: np.ndarray | None = None
    shaken_from_raw: np.ndarray | None = None

    def save(self, path: Path) -> None:
        """Write what an estimator gets to see, an .npz file."""
        np.savez(path, frames=self.frames, boxes=self.boxes)

    def errors(self, found: np.ndarray, found_unshaken: np.ndarray | None) -> np.ndarray:
        """Mean distance of the four corners from where they should be, frame by frame.

        Pixels for a drawn scene. For real footage % of the width; `found_unshaken` is then what
        the same estimator found on the footage as it was.
        """
        height, width = self.frames.shape[1:3]
        if self.cur_from_prev is not None:
            return corner_distances(found, self.cur_from_prev, (width, height))[_SETTLED:]
        assert self.shaken_from_raw is not None
        assert found_unshaken is not None
        prev_raw_from_shaken = np.linalg.inv(self.shaken_from_raw[:-1])
        wanted = self.shaken_from_raw[1:] @ found_unshaken[1:] @ prev_raw_from_shaken
        return 100 / width * corner_distances(found[1:], wanted, (width, height))


def corner_distances(found: np.ndarray, wanted: np.ndarray, size_wh: tuple[int, int]) -> np.ndarray:
    """Mean distance (N,) of the frame's corners between transforms (N, 3, 3), pixels."""
    corners = corners_from_xywh((0, 0, *size_wh))
    moved = [
        map_points(f, corners) - map_points(w, corners) for f, w in zip(found, wanted, strict=True)
    ]
    return np.linalg.norm(moved, axis=2).mean(axis=1)


def drawn_clips(
    sizes_wh: Sequence[tuple[int, int]], count: int, seeds: int, no_box: Sequence[str]
) -> Iterator[Clip]:
    """The scenes of bench/motion_bench.py; those in `no_box` a second time, target untold."""
    sys.path.append(str(SHARED / "bench"))
    try:
        import motion_bench
    except ModuleNotFoundError as error:
        raise SystemExit(
            f"{SHARED / 'bench'} is absent: set SSIAM_SHARED to the folder of the test data"
        ) from error
    for width, height in sizes_wh:
        for scene in motion_bench.SCENES:
            for seed in range(seeds):
                frames, frame_from_world, boxes = motion_bench.video(
                    width, height, scene, count, seed
                )
                motion = [cur @ np.linalg.inv(prev) for prev, cur in pairwise(frame_from_world)]
                clip = Clip(
                    place=f"{width}x{height}",
                    scene=scene,
                    name=f"seed {seed}",
                    frames=np.stack(frames),
                    boxes=np.array(boxes, dtype=np.float64),
                    cur_from_prev=np.stack([np.eye(3), *motion]),
                )
                yield clip
                if scene in no_box:
                    yield replace(clip, scene=scene + NO_BOX, exclude=False)


def real_clips(count: int) -> Iterator[Clip]:
    """Every sequence as it is, and after it under each shake; the same at every run."""
    for name, sequence in sequences().items():
        frames = np.stack(list(islice(sequence.images(), count)))
        boxes = np.array([sequence.box(index) for index in range(len(frames))])
        plain = Clip(REAL, UNSHAKEN, name, frames, boxes)
        yield plain
        for shake in SHAKES:
            yield shaken(plain, shake)


def shaken(plain: Clip, shake: str) -> Clip:
    """The clip as a camera would have seen it that moves by one of `SHAKES` more."""
    count, height, width = plain.frames.shape[:3]
    shaken_from_raw = poses(shake, count, (width, height), plain.name)
    frames = [
        cv2.warpAffine(frame, pose[:2], (width, height), borderMode=cv2.BORDER_REFLECT_101)
        for frame, pose in zip(plain.frames, shaken_from_raw, strict=True)
    ]
    boxes = [map_box(p, b) for p, b in zip(shaken_from_raw, plain.boxes, strict=True)]
    return replace(
        plain,
        scene=shake,
        frames=np.stack(frames),
        boxes=np.array(boxes),
        shaken_from_raw=np.stack(shaken_from_raw),
    )


def poses(shake: str, count: int, size_wh: tuple[int, int], name: str) -> list[np.ndarray]:
    """shaken_from_raw of every frame; the same at every run."""
    rng = np.random.default_rng(sum(map(ord, name + shake)))
    width = size_wh[0]
    if shake == "hand-held":
        steps = hand_held(count, rng) * (0.05 * width, 0.05 * width, np.deg2rad(2))
    else:
        share = float(shake.split()[0]) / 100
        steps = rng.normal(0, (share * width, share * width, np.deg2rad(1)), (count, 3))
    return [rigid(*step, frame_centre(size_wh)) for step in steps]


def hand_held(count: int, rng: np.random.Generator) -> np.ndarray:
    """Path (count, 3) with a 1/f amplitude and standard deviation 1 in each column."""
    frequency = np.fft.rfftfreq(count)[:, None]
    amplitude = np.divide(1, frequency, out=np.zeros_like(frequency), where=frequency > 0)
    phase = np.exp(2j * np.pi * rng.random((len(frequency), 3)))
    path = np.fft.irfft(amplitude * phase, count, axis=0)
    return path / path.std(axis=0)
