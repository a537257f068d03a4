"""Fig. 3 of the paper: the camera's path over a sequence, as it is and smoothed."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ssiam.datasets import VideoSequence
from ssiam.evaluation.canvas import BLUE, GREY, ORANGE, SMALL, bare, canvas, png
from ssiam.evaluation.raster import Floats
from ssiam.motion import CameraMotion
from ssiam.stabilize import CameraPath, StabilizerConfig

_AXES: Final = (
    ("dx", "px, right", 1.0),
    ("dy", "px, down", 1.0),
    ("da", "degrees, clockwise", 180 / np.pi),
)


def figure3(sequence: VideoSequence, config: StabilizerConfig) -> bytes:
    """The camera's path (dx, dy, da) over the frames of a sequence, as a PNG.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    SourceError
        A frame cannot be read.
    """
    path, smooth, reliable = camera_path(sequence, config)
    figure, panels = canvas((9, 6.4), (3, 1), sharex=True)
    for column, (panel, (name, unit, factor)) in enumerate(zip(panels.flat, _AXES, strict=True)):
        for frame in np.flatnonzero(~reliable):
            panel.axvspan(frame - 0.5, frame + 0.5, color=GREY, lw=0, zorder=0)
        panel.plot(factor * path[:, column], color=ORANGE, lw=1.1, label="camera path")
        panel.plot(factor * smooth[:, column], color=BLUE, lw=1.7, label="smoothed path")
        panel.set_ylabel(f"{name}  ({unit})")
        bare(panel)
    figure.align_ylabels()
    panels[0, 0].legend(loc="best", frameon=False, fontsize=SMALL)
    panels[-1, 0].set_xlabel("frame")
    return png(figure)


def camera_path(
    sequence: VideoSequence, config: StabilizerConfig
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The camera's path (N, 3), the smoothed one (N, 3), and which motions are known (N,).

    dx and dy in pixels at the image centre, da in radians, summed from the first frame on. The
    truth is left out of the estimate. Where a motion is not known, both paths stand still.
    """
    camera = CameraMotion(config.keypoints, config.fit, model="rigid")
    past = CameraPath(config.paper.window)
    steps, differences, reliable = [], [], []
    for index, image in enumerate(sequence.images()):
        motion = camera.update(image, exclude=_target(sequence, index - 1))
        known = motion.reliable or index == 0
        if known:
            past.advance(motion)
        steps.append(motion.shift_angle if known else (0.0, 0.0, 0.0))
        differences.append(past.difference())
        reliable.append(known)
    path = np.cumsum(steps, axis=0)
    return path, path + np.array(differences), np.array(reliable)


def _target(sequence: VideoSequence, index: int) -> tuple[float, ...] | None:
    known = 0 <= index < len(sequence.truth) and np.isfinite(sequence.truth[index]).all()
    return sequence.box(index) if known else None
