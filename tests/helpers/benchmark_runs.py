"""Small trajectories for the tests of evaluation."""

import numpy as np

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.trajectory import Status, TrackedSequence, Trajectory

SIZE = (320, 240)


def square(count, left=100.0, top=80.0, side=40.0):
    """Polygons (count, 8) of a square that moves right by 1 px per frame."""
    x = left + np.arange(count)[:, None]
    y = np.full((count, 1), top)
    return np.hstack([x, y, x + side, y, x + side, y + side, x, y + side])


def trajectory(codes, truth, shift=0.0):
    """A run by frame: i start, x lost, - skipped, any other letter tracked with an offset."""
    status = np.array([Status({"i": 1, "x": 2, "-": 0}.get(code, 3)) for code in codes], np.int8)
    regions = truth[: len(codes)] + shift
    return Trajectory(status, np.where(status[:, None] == Status.TRACKED, regions, np.nan))


def tracked(codes, name="one", shift=0.0, tags=None, repetitions=1, length=None):
    """A `TrackedSequence` of `square` with runs of these codes."""
    truth = square(length or len(codes))
    sequence = VideoSequence(name, (), truth, tags=tags or {}, size_wh=SIZE)
    return TrackedSequence(sequence, (trajectory(codes, truth, shift),) * repetitions)


def same(a, b, atol=0.0):
    np.testing.assert_array_equal(a.status, b.status)
    np.testing.assert_allclose(a.regions, b.regions, atol=atol)


def golden_runs(data):
    """The runs in the golden file vot_eval.npz."""
    runs = []
    for name in data["names"]:
        truth, written = data[f"{name}_gt"], data[f"{name}_pred"]
        is_code = np.isnan(written[:, 1])
        status = np.where(is_code, written[:, 0], Status.TRACKED).astype(np.int8)
        run = Trajectory(status, np.where(is_code[:, None], np.nan, written))
        runs.append(TrackedSequence(VideoSequence(str(name), (), truth, size_wh=SIZE), (run,)))
    return runs
