"""`shaken`: any sequence as a shaking camera would record it, with its ground truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets.dataset import Dataset, LazySequences
from ssiam.datasets.sequence import VideoSequence, with_size
from ssiam.datasets.shake.camera import Shake, ShakingCamera, shaking_camera
from ssiam.errors import FrameSizeError
from ssiam.geometry import Image, Transform, area_preserving_xywh, map_box


@dataclass(frozen=True, eq=False, kw_only=True)
class ShakenSequence(VideoSequence):
    """A sequence recorded by a shaking camera: `frames` are raw, `images` are shaken.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    truth : (N, 4) or (N, 8) float64
        Ground truth in the shaken frames; nan where it is unknown, or the target is outside them.
    raw : VideoSequence
        The raw sequence; its `size_wh` is set.
    shake : Shake
    camera : ShakingCamera
    shaken_from_raw : (N, 3, 3) float64
        Raw-frame pixels to pixels of the shaken frame: the mean over the exposure, and for a
        rolling shutter the pose of the middle row.
    """

    raw: VideoSequence
    shake: Shake
    camera: ShakingCamera
    shaken_from_raw: Transform

    def images(self, start: int = 0) -> Iterator[Image]:
        """The shaken frames (H, W, 3) uint8 BGR from index `start` on.

        Raises
        ------
        SourceError, StreamError
            As `VideoSequence.images`.
        FrameSizeError
            A frame does not have the `size_wh` of the raw sequence.
        """
        if self.shake.strength == 0:
            yield from self.raw.images(start)
            return
        width, height = self.raw.size_wh or (0, 0)
        for index, image in enumerate(self.raw.images(start), start):
            if image.shape[:2] != (height, width):
                raise FrameSizeError(
                    f"sequence {self.name}: frame {index} is {image.shape[1]}x{image.shape[0]}, "
                    f"not {width}x{height} pixels; shake needs frames of one size"
                )
            yield self.camera.render(image, index)


def shaken(sequence: VideoSequence, shake: Shake) -> ShakenSequence:
    """The sequence with camera shake added to the camera's own motion.

    Reads the first image if the `size_wh` of the sequence is not known. With a strength of 0,
    frames and ground truth are the raw ones, bit for bit.

    Raises
    ------
    ArgumentError
        Less than 16 pixels of the width or height are left after cropping.
    SourceError, StreamError
        The first image cannot be read.
    """
    raw = with_size(sequence)
    camera = shaking_camera(shake, len(raw), raw.size_wh or (0, 0), raw.name)
    return ShakenSequence(
        name=sequence.name,
        frames=sequence.frames,
        truth=_mapped(sequence.truth, camera) if shake.strength else sequence.truth,
        tags=sequence.tags,
        first=sequence.first,
        size_wh=camera.size_wh,
        count=sequence.count,
        others=_mapped_others(sequence, camera) if shake.strength else sequence.others,
        raw=raw,
        shake=shake,
        camera=camera,
        shaken_from_raw=camera.poses(np.arange(len(sequence), dtype=np.float64)),
    )


def shaken_dataset(dataset: Dataset, shake: Shake) -> Dataset:
    """The dataset with every sequence `shaken` at lookup."""

    def read(name: str) -> VideoSequence:
        return shaken(dataset.sequences[name], shake)

    readers = {name: partial(read, name) for name in dataset.sequences}
    return replace(dataset, sequences=LazySequences(readers))


def _mapped_others(
    sequence: VideoSequence, camera: ShakingCamera
) -> dict[str, NDArray[np.float64]]:
    return {name: _mapped(boxes, camera) for name, boxes in sequence.others.items()}


def _mapped(truth: NDArray[np.float64], camera: ShakingCamera) -> NDArray[np.float64]:
    """Map boxes (N, 4) or polygons (N, 8) of the raw frames to the frames of the camera."""
    mapped_truth = np.full_like(truth, np.nan)
    known = np.flatnonzero(np.isfinite(truth).all(axis=1))
    rows = truth[known]
    if truth.shape[1] == 4:
        poses = camera.row_poses(rows[:, :2] + rows[:, 2:] / 2, known.astype(np.float64))
        for index, pose in zip(known, poses, strict=True):
            mapped_truth[index] = map_box(pose, truth[index])
    else:
        corners = rows.reshape(-1, 2)
        poses = camera.row_poses(corners, np.repeat(known, 4).astype(np.float64))
        mapped = (poses[:, :2, :2] @ corners[:, :, None])[:, :, 0] + poses[:, :2, 2]
        mapped_truth[known] = mapped.reshape(-1, 8)
    outside = [index for index in known if _outside(mapped_truth[index], camera.size_wh)]
    mapped_truth[outside] = np.nan
    return mapped_truth


def _outside(row: NDArray[np.float64], size_wh: tuple[int, int]) -> bool:
    x, y, w, h = row if len(row) == 4 else area_preserving_xywh(row.reshape(4, 2))
    return bool(x + w <= 0 or y + h <= 0 or x >= size_wh[0] or y >= size_wh[1])
