"""Fig. 3, 4 and 5 of the paper: the camera's path, the correction, and a transformed frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.regions import Floats
from ssiam.evaluation.paper.canvas import (
    BLUE,
    GRAY,
    GREEN,
    ORANGE,
    SMALL,
    canvas,
    png,
    style_axes,
)
from ssiam.geometry import Transform, corners_from_xywh
from ssiam.motion import CameraMotion
from ssiam.stabilize import CameraPath, FrameView, Stabilizer, StabilizerConfig

_AXES: Final = (("x", "px, right"), ("y", "px, down"))
_IMAGE_WIDTH: Final = 4.6  # inches, of the original frame in Fig. 5


@dataclass(frozen=True, eq=False)
class CameraRecord:
    """What the stabilizer computes for each of N frames.

    Attributes
    ----------
    path, smooth : (N, 3) float64
        The camera path raw and smoothed: dx and dy in pixels at the image center and da in
        radians, summed from the first frame on.
    new_trans : (N, 3) float64
        dx, dy, da of the correction (eq. 5), before the limits of eq. 6.
    stab_from_raw : (N, 3, 3) float64
        The applied transform (eq. 7), after the limits.
    reliable : (N,) bool
        Whether the motion to the frame is known; both paths stay constant where it is not.
    """

    path: Floats
    smooth: Floats
    new_trans: Floats
    stab_from_raw: Transform
    reliable: NDArray[np.bool_]


def record_camera(sequence: VideoSequence, config: StabilizerConfig) -> CameraRecord:
    """Run the stabilizer over a sequence; the true box is excluded from the motion estimate.

    Raises
    ------
    SourceError
        A frame cannot be read.
    """
    camera = CameraMotion(config.keypoints, config.fit, model="rigid", spread=config.spread)
    recent_path, stabilizer = CameraPath(config.paper.window), Stabilizer(config)
    steps, corrections, transforms, reliable = [], [], [], []
    for index, image in enumerate(sequence.images()):
        motion = camera.update(image, exclude=_target(sequence, index - 1))
        is_reliable = motion.reliable or index == 0
        if is_reliable:
            recent_path.advance(motion)
        steps.append(motion.shift_angle if is_reliable else (0.0, 0.0, 0.0))
        corrections.append(recent_path.difference())
        transforms.append(stabilizer.update(motion))
        reliable.append(is_reliable)
    path, new_trans = np.cumsum(steps, axis=0), np.array(corrections)
    return CameraRecord(path, path + new_trans, new_trans, np.array(transforms), np.array(reliable))


def _target(sequence: VideoSequence, index: int) -> tuple[float, ...] | None:
    """The true box in a frame; None if there is none."""
    known = 0 <= index < len(sequence.truth) and np.isfinite(sequence.truth[index]).all()
    return sequence.box(index) if known else None


def draw_path(record: CameraRecord) -> bytes:
    """Fig. 3 as a PNG: the accumulated x and y over the frames, and their moving average."""
    figure, panels = canvas((9, 5), (2, 1), sharex=True)
    for column, (panel, (name, unit)) in enumerate(zip(panels.flat, _AXES, strict=True)):
        for frame in np.flatnonzero(~record.reliable):
            panel.axvspan(frame - 0.5, frame + 0.5, color=GRAY, lw=0, zorder=0)
        panel.plot(record.path[:, column], color=ORANGE, lw=1.1, label="accumulated")
        panel.plot(record.smooth[:, column], color=BLUE, lw=1.7, label="smoothed")
        panel.set_ylabel(f"{name}  ({unit})")
        style_axes(panel)
    figure.align_ylabels()
    panels[0, 0].legend(loc="best", frameon=False, fontsize=SMALL)
    panels[-1, 0].set_xlabel("frame")
    return png(figure)


def draw_correction(record: CameraRecord) -> bytes:
    """Fig. 4 as a PNG: dx, dy and da of new_trans over the frames."""
    figure, panels = canvas((9, 3.6), (1, 1))
    panel = panels[0, 0]
    angles = panel.twinx()
    dx, dy, da = record.new_trans.T
    lines = [
        *panel.plot(dx, color=BLUE, lw=1.2, label="dx"),
        *panel.plot(dy, color=ORANGE, lw=1.2, label="dy"),
        *angles.plot(np.degrees(da), color=GREEN, lw=1.2, label="da (right scale)"),
    ]
    style_axes(panel)
    angles.spines["top"].set_visible(False)
    # Zero is at the same height on both scales.
    for axes, values in ((panel, (dx, dy)), (angles, (np.degrees(da),))):
        reach = 1.08 * max(float(np.abs(values).max()), 1e-3)
        axes.set_ylim(-reach, reach)
    panel.set(xlabel="frame", ylabel="dx, dy  (px, right and down)")
    angles.set_ylabel("da  (degrees, clockwise)")
    panel.legend(handles=lines, loc="best", ncols=3, frameon=False, fontsize=SMALL)
    return png(figure)


def most_moved(record: CameraRecord, size_wh: tuple[int, int]) -> int:
    """Index of the frame that is moved farthest; 0 if none is moved."""
    corners = np.pad(corners_from_xywh((0, 0, *size_wh)), ((0, 0), (0, 1)), constant_values=1.0)
    moved = (record.stab_from_raw @ corners.T)[:, :2] - corners.T[:2]
    return int(np.linalg.norm(moved, axis=1).max(axis=1).argmax())


def draw_transformed(sequence: VideoSequence, record: CameraRecord, index: int, n: int) -> bytes:
    """Fig. 5 as a PNG: a frame beside the transformed one with a border of `n` pixels.

    Raises
    ------
    SourceError
        The frame cannot be read.
    """
    raw = next(sequence.images(index))
    transformed = FrameView(raw, record.stab_from_raw[index], n).render()
    widths = [raw.shape[1], transformed.shape[1]]
    inch = _IMAGE_WIDTH / raw.shape[1]
    size = sum(widths) * inch + 0.3, transformed.shape[0] * inch + 0.5
    figure, panels = canvas(size, (1, 2), gridspec_kw={"width_ratios": widths})
    for panel, image, title in zip(
        panels[0], (raw, transformed), ("original", "transformed"), strict=True
    ):
        panel.imshow(image[..., ::-1])
        panel.set_title(title)
        panel.set_axis_off()
    return png(figure)
