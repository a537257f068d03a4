"""The second column of Table 4: whether a sequence needs stabilization."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from ssiam.motion import Motion
from ssiam.stabilize import PaperConfig, Stabilizer, StabilizerConfig

WINDOW_JUDGE: Final = PaperConfig(judge="window")


def needs_stabilization(motions: Iterable[Motion], config: PaperConfig = WINDOW_JUDGE) -> bool:
    """Whether the threshold judge (Fig. 2) finds shake in more than half of the frames.

    Parameters
    ----------
    motions : iterable of Motion
        The camera's motion to each frame, as of `CameraMotion`.
    config : PaperConfig
        With the judge; by default "window" with its measured threshold.
    """
    stabilizer = Stabilizer(StabilizerConfig("paper", paper=config))
    answers = []
    for motion in motions:
        stabilizer.update(motion)
        answers.append(stabilizer.shakes)
    return 2 * sum(answers) > len(answers)
