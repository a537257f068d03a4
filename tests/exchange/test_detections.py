"""Tracks as supervision's detections, with the real supervision."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import supervision

from ssiam.errors import ArgumentError, MissingExtraError
from ssiam.exchange import to_detections
from ssiam.exchange.detections import detection_fields
from ssiam.track import Track

CORNERS = np.array([[20.0, 10.0], [40.0, 20.0], [35.0, 30.0], [15.0, 20.0]])
MASK = np.zeros((60, 80), bool)
MASK[10:30, 15:40] = True
PLAIN = Track((1.0, 2.0, 30.0, 40.0), score=0.75)
ROTATED = Track((15.0, 10.0, 25.0, 20.0), score=0.5, corners=CORNERS, mask=MASK)
LOST = Track((5.0, 6.0, 7.0, 8.0), score=0.1, lost=True)
NOT_FINITE = Track((float("nan"), 6.0, 7.0, 8.0))


def test_lost_targets_are_omitted():
    fields = detection_fields([PLAIN, LOST, NOT_FINITE, ROTATED], ids=[3, 4, 5, 9])
    assert fields["xyxy"].tolist() == [[1, 2, 31, 42], [15, 10, 40, 30]]
    assert fields["confidence"].tolist() == [0.75, 0.5]
    assert fields["tracker_id"].tolist() == [3, 9]
    upright = [[1, 2], [31, 2], [31, 42], [1, 42]]
    assert fields["data"]["corners"].tolist() == [upright, CORNERS.tolist()]
    assert fields["data"]["xyxyxyxy"].tolist() == [upright, CORNERS.tolist()]
    assert fields["mask"] is None  # one of them has none


def test_ids_count_from_1():
    fields = detection_fields([LOST, PLAIN])
    assert fields["tracker_id"].tolist() == [2]
    assert list(fields["data"]) == ["corners"]


def test_masks_are_stacked():
    fields = detection_fields([ROTATED, LOST, ROTATED])
    assert fields["mask"].shape == (2, 60, 80)
    assert (fields["mask"] == MASK).all()


@pytest.mark.parametrize("tracks", [[], [LOST]], ids=["no targets", "all lost"])
def test_empty_detections_have_valid_shapes(tracks):
    fields = detection_fields(tracks)
    assert {name: np.shape(fields[name]) for name in ("xyxy", "confidence", "tracker_id")} == {
        "xyxy": (0, 4),
        "confidence": (0,),
        "tracker_id": (0,),
    }
    assert fields["data"]["corners"].shape == (0, 4, 2)


def test_number_of_ids_must_match_tracks():
    with pytest.raises(ArgumentError, match="1 ids for 2 tracks"):
        detection_fields([PLAIN, ROTATED], ids=[1])


def test_missing_supervision_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "supervision", None)
    with pytest.raises(MissingExtraError, match=r"pip install supervision$"):
        to_detections([PLAIN])


@pytest.mark.parametrize(
    ("tracks", "count"),
    [
        pytest.param([PLAIN, LOST, ROTATED], 2, id="some"),
        pytest.param([ROTATED, ROTATED], 2, id="masks"),
        pytest.param([LOST], 0, id="none"),
    ],
)
def test_supervision_accepts_the_fields(tracks, count):
    detections = to_detections(tracks)
    assert isinstance(detections, supervision.Detections)
    assert len(detections) == count
    assert [row[4] for row in detections] == detections.tracker_id.tolist()
    assert len(detections[detections.confidence > 0.6]) == (PLAIN in tracks)


def test_supervision_draws_the_boxes():
    detections = to_detections([PLAIN, ROTATED], ids=[4, 7])
    by_track = {"color_lookup": supervision.ColorLookup.TRACK, "thickness": 1}
    for annotator in (supervision.BoxAnnotator, supervision.OrientedBoxAnnotator):
        scene = annotator(**by_track).annotate(np.zeros((60, 80, 3), np.uint8), detections)
        drawn = np.argwhere(scene.any(axis=2))
        assert drawn.min(axis=0).tolist() == [2, 1]
        assert drawn.max(axis=0).tolist() == [42, 40]
