"""The second column of Table 4: whether a sequence needs stabilization."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from ssiam.datasets import VideoSequence
from ssiam.errors import SsiamError, one_line
from ssiam.evaluation.paper.camera_motions import camera_motions
from ssiam.motion import Motion
from ssiam.stabilize import PaperConfig, Stabilizer, StabilizerConfig

WINDOW_JUDGE: Final = PaperConfig(judge="window")
_CAMERA: Final = StabilizerConfig("paper")


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


def judge_sequences(sequences: Iterable[VideoSequence]) -> tuple[dict[str, bool], list[str]]:
    """Whether each sequence needs stabilization, by the paper's keypoints in its images.

    Returns
    -------
    judged : dict of str to bool
        By sequence, without those whose images cannot be read.
    notes : list of str
        A line for each of these.
    """
    judged, notes = {}, []
    for each in sequences:
        try:
            judged[each.name] = needs_stabilization(camera_motions(each, _CAMERA))
        except SsiamError as error:
            notes.append(f"{each.name}: not judged in Table 4: {one_line(error)}")
    return judged, notes
