"""`camera_motions`: the camera's motion through a sequence, estimated from its images."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.motion import CameraMotion, Motion
from ssiam.stabilize import StabilizerConfig


def camera_motions(sequence: VideoSequence, config: StabilizerConfig) -> Iterator[Motion]:
    """The motion to each frame; the true box of the frame before is excluded from the estimate.

    Parameters
    ----------
    sequence : VideoSequence
    config : StabilizerConfig
        Keypoints and fit; the motion is rigid, as in the paper.

    Raises
    ------
    SourceError
        A frame cannot be read.
    """
    camera = CameraMotion(config.keypoints, config.fit, model="rigid", spread=config.spread)
    for index, image in enumerate(sequence.images()):
        yield camera.update(image, exclude=_target(sequence, index - 1))


def _target(sequence: VideoSequence, index: int) -> tuple[float, ...] | None:
    """The true box in a frame; None if there is none."""
    known = 0 <= index < len(sequence.truth) and np.isfinite(sequence.truth[index]).all()
    return sequence.box(index) if known else None
