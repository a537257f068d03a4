"""Reports of one-pass results."""

import io

import numpy as np
import pytest
from rich.console import Console

from ssiam.datasets import VideoSequence
from ssiam.evaluation.measures.regions import upright
from ssiam.evaluation.measures.trajectory import Status, Trajectory
from ssiam.evaluation.reports import (
    OnePassReport,
    one_pass,
    one_pass_table,
    scores_table,
    tags_table,
)
from ssiam.evaluation.runs.result_files import vot_path, write_vot

COUNT = 12


def test_the_name_of_a_tracker_is_printed_as_it_is():
    table = one_pass_table([OnePassReport("kcf[red]", *[0.5] * 6, 3)])
    console = Console(width=120, file=io.StringIO())
    console.print(table)
    assert "kcf[red]" in console.file.getvalue()


def rotated_box(x):
    """Corners of a rectangle rotated by 30 degrees."""
    angle = np.deg2rad(30)
    along, across = (
        np.array([np.cos(angle), np.sin(angle)]),
        np.array([-np.sin(angle), np.cos(angle)]),
    )
    corners = [-30 * along - 10 * across, 30 * along - 10 * across]
    corners += [-corner for corner in corners]
    return np.add(corners, (x, 80)).ravel()


def test_rotated_boxes_are_measured_by_their_upright_boxes(tmp_path):
    truth = np.array([rotated_box(60 + 2 * t) for t in range(COUNT)])
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


def test_heads_of_the_tables():
    heads = {
        table: [column.header for column in table(()).columns]
        for table in (scores_table, tags_table)
    }
    assert heads[scores_table] == ["tracker", "A", "R /100", "EAO", "lost", "A", "R /seq", "EAO"]
    assert heads[tags_table] == ["tracker", "tag", "A", "R /100", "EAO", "lost", "frames"]
