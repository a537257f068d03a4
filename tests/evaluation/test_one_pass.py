"""One-pass results from the folders they lie in."""

import numpy as np
import pytest

from ssiam.datasets import VideoSequence
from ssiam.evaluation.layouts import vot_path, write_vot
from ssiam.evaluation.one_pass import one_pass
from ssiam.evaluation.regions import upright
from ssiam.evaluation.trajectory import Status, Trajectory

COUNT = 12


def leaning(x):
    """Corners of a rectangle that is turned by 30 degrees."""
    angle = np.deg2rad(30)
    along, across = (
        np.array([np.cos(angle), np.sin(angle)]),
        np.array([-np.sin(angle), np.cos(angle)]),
    )
    corners = [-30 * along - 10 * across, 30 * along - 10 * across]
    corners += [-corner for corner in corners]
    return np.add(corners, (x, 80)).ravel()


def test_rotated_boxes_are_measured_by_the_box_of_their_area(tmp_path):
    truth = np.array([leaning(60 + 2 * t) for t in range(COUNT)])
    sequence = VideoSequence(
        name="bolt", frames=tuple(f"{t}.jpg" for t in range(COUNT)), truth=truth
    )
    status = np.full(COUNT, Status.TRACKED, dtype=np.int8)
    status[0] = Status.INITIALIZED
    path = vot_path(tmp_path, "bolt", experiment="unsupervised")
    write_vot(path, Trajectory(status, truth))
    assert one_pass(tmp_path, [sequence]).ao == pytest.approx(1, abs=1e-3)
    boxes = np.column_stack([np.add(upright(truth), (10, 0, 0, 0)), np.full((COUNT, 4), np.nan)])
    write_vot(path, Trajectory(status, boxes))
    width = upright(truth)[0, 2]
    assert one_pass(tmp_path, [sequence]).ao == pytest.approx((width - 10) / (width + 10), abs=1e-3)
