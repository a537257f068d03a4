"""Clips with known camera motion: drawn scenes, and real footage with synthetic shake.

The motion of a drawn scene is known. Of real footage only the added shake is known: the estimate
on a shaken pair of frames must be the estimate on the unshaken pair with the shake applied. Both
need the folder of test data (see benchmarks/common/data.py).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.data import SHARED, sequences
from ssiam.geometry import corners_from_xywh, frame_center, map_box, map_points, rigid

Floats = NDArray[np.float64]

REAL = "real"
UNSHAKEN = "unshaken"
SHAKES = ("2 %", "3 %", "5 %", "hand-held")
NO_BOX = ", no box"
_WARM_UP = 3  # frames of a drawn scene that do not count, as in bench/motion_bench.py


@dataclass(frozen=True, eq=False)
class Clip:
    """Frames, true boxes and the known part of the camera motion.

    Attributes
    ----------
    source : str
        Size of a drawn scene, such as "640x360", or "real".
    scene : str
        Name of the drawn scene, or of the shake.
    name : str
        Seed of the drawn scene, or name of the sequence.
    frames : (N, H, W, 3) uint8 BGR
    boxes : (N, 4) float64
        True boxes x, y, w, h of the target, pixels.
    exclude : bool
        Whether estimators receive the target's box to exclude it.
    cur_from_prev : (N, 3, 3) float64, optional
        True motion of a drawn scene.
    shaken_from_raw : (N, 3, 3) float64, optional
        The synthetic shake of real footage.
    """

    source: str
    scene: str
    name: str
    frames: NDArray[np.uint8]
    boxes: Floats
    exclude: bool = True
    cur_from_prev: Floats | None = None
    shaken_from_raw: Floats | None = None

    def save(self, path: Path) -> None:
        """Write frames and boxes, the input of an estimator, as an .npz file."""
        np.savez(path, frames=self.frames, boxes=self.boxes)

    def errors(self, found: Floats, found_unshaken: Floats | None) -> Floats:
        """Mean distance of the four corners from their true positions, by frame.

        In pixels for a drawn scene. In % of the width for real footage, which also needs the
        estimates on the unshaken footage, `found_unshaken`.
        """
        height, width = self.frames.shape[1:3]
        if self.cur_from_prev is not None:
            return corner_distances(found, self.cur_from_prev, (width, height))[_WARM_UP:]
        assert self.shaken_from_raw is not None
        assert found_unshaken is not None
        prev_raw_from_shaken = np.linalg.inv(self.shaken_from_raw[:-1])
        true = self.shaken_from_raw[1:] @ found_unshaken[1:] @ prev_raw_from_shaken
        return np.asarray(100 / width * corner_distances(found[1:], true, (width, height)))


def corner_distances(found: Floats, true: Floats, size_wh: tuple[int, int]) -> Floats:
    """Mean distance (N,) of the mapped frame corners between transforms (N, 3, 3), pixels."""
    corners = corners_from_xywh((0, 0, *size_wh))
    moved = [
        map_points(f, corners) - map_points(t, corners) for f, t in zip(found, true, strict=True)
    ]
    return np.asarray(np.linalg.norm(moved, axis=2).mean(axis=1))


def drawn_clips(
    sizes_wh: Sequence[tuple[int, int]], count: int, seeds: int, no_box: Sequence[str]
) -> Iterator[Clip]:
    """The scenes of bench/motion_bench.py; those in `no_box` a second time without the box."""
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
                    source=f"{width}x{height}",
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
    """Every sequence unshaken, then under each shake; the same in every run."""
    for name, sequence in sequences().items():
        frames = np.stack(list(islice(sequence.images(), count)))
        boxes = np.array([sequence.box(index) for index in range(len(frames))])
        unshaken = Clip(REAL, UNSHAKEN, name, frames, boxes)
        yield unshaken
        for shake in SHAKES:
            yield shaken(unshaken, shake)


def shaken(clip: Clip, shake: str) -> Clip:
    """The clip with one of `SHAKES` added to its camera motion."""
    count, height, width = clip.frames.shape[:3]
    shaken_from_raw = poses(shake, count, (width, height), clip.name)
    frames = [
        cv2.warpAffine(frame, pose[:2], (width, height), borderMode=cv2.BORDER_REFLECT_101)
        for frame, pose in zip(clip.frames, shaken_from_raw, strict=True)
    ]
    boxes = [map_box(p, b) for p, b in zip(shaken_from_raw, clip.boxes, strict=True)]
    return replace(
        clip,
        scene=shake,
        frames=np.stack(frames),
        boxes=np.array(boxes),
        shaken_from_raw=np.stack(shaken_from_raw),
    )


def poses(shake: str, count: int, size_wh: tuple[int, int], name: str) -> list[Floats]:
    """shaken_from_raw of every frame; the same in every run."""
    rng = np.random.default_rng(sum(map(ord, name + shake)))
    width = size_wh[0]
    if shake == "hand-held":
        steps = hand_held(count, rng) * (0.05 * width, 0.05 * width, np.deg2rad(2))
    else:
        share = float(shake.split()[0]) / 100
        steps = rng.normal(0, (share * width, share * width, np.deg2rad(1)), (count, 3))
    return [rigid(dx, dy, angle, frame_center(size_wh)) for dx, dy, angle in steps]


def hand_held(count: int, rng: np.random.Generator) -> Floats:
    """Path (count, 3) with a 1/f amplitude and standard deviation 1 in each column."""
    frequency = np.fft.rfftfreq(count)[:, None]
    amplitude = np.divide(1, frequency, out=np.zeros_like(frequency), where=frequency > 0)
    phase = np.exp(2j * np.pi * rng.random((len(frequency), 3)))
    path = np.fft.irfft(amplitude * phase, count, axis=0)
    return np.asarray(path / path.std(axis=0))
