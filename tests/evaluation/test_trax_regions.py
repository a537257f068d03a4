"""Regions of the TraX protocol: start boxes and reported regions."""

import numpy as np
import pytest

from ssiam.errors import ArgumentError
from ssiam.evaluation.measures.overlap import toolkit_overlap
from ssiam.geometry import area_preserving_xywh, map_points, rigid
from ssiam.track import Track

trax = pytest.importorskip("trax")

from ssiam.evaluation.vot.trax import _region_from_track, _start_box  # noqa: E402

SIZE = (320, 240)


def upright(x, y, w, h):
    return np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])


def polygon(points):
    return trax.Polygon.create([tuple(map(float, point)) for point in points])


def start_xywh(region):
    start = _start_box(region)
    return tuple(start) if len(start) == 4 else area_preserving_xywh(start)


def row(region):
    if region.type == "rectangle":
        return [*region.bounds(), *[np.nan] * 4]
    return np.ravel(list(region))


def overlap(region, truth):
    return toolkit_overlap([row(region)], [row(truth)], SIZE)[0]


@pytest.mark.parametrize(
    "truth",
    [
        pytest.param(polygon(upright(60, 50, 44, 32)), id="polygon"),
        pytest.param(polygon(upright(60.3, 50.8, 20.4, 13.7)), id="polygon between pixels"),
        pytest.param(trax.Rectangle.create(60, 50, 44, 32), id="rectangle"),
        pytest.param(trax.Rectangle.create(60.3, 50.8, 20.4, 13.7), id="rectangle between pixels"),
    ],
)
def test_the_true_box_has_overlap_1(truth):
    found = _region_from_track(Track(start_xywh(truth)), truth)
    assert found.type == truth.type
    assert overlap(found, truth) == 1


def test_no_other_convention_is_better_on_rotated_targets():
    gained = []
    for angle in np.linspace(-0.7, 0.7, 60):
        truth = polygon(map_points(rigid(150 + angle, 120, angle), upright(-30, -18, 60, 36)))
        x, y, w, h = start_xywh(truth)
        ours = overlap(_region_from_track(Track((x, y, w, h)), truth), truth)
        others = trax.Rectangle.create(x, y, w, h), polygon(upright(x, y, w, h))
        gained.append([ours - overlap(other, truth) for other in others])
    assert (np.mean(gained, axis=0) > 0).all()


def test_rotated_boxes_are_reported_as_polygons():
    corners = map_points(rigid(150, 120, 0.4), upright(-30, -18, 60, 36))
    for start in (trax.Rectangle.create(1, 2, 3, 4), polygon(upright(1, 2, 3, 4))):
        found = _region_from_track(Track((120, 100, 60, 40), corners=corners), start)
        np.testing.assert_allclose(list(found), corners, atol=1e-4)


def test_a_polygon_of_many_points_is_its_smallest_rotated_box():
    rotated = map_points(rigid(150, 120, 0.4), upright(-30, -18, 60, 36))
    halves = np.concatenate([rotated, (rotated + np.roll(rotated, -1, axis=0)) / 2])
    order = [0, 4, 1, 5, 2, 6, 3, 7]
    np.testing.assert_allclose(
        start_xywh(polygon(halves[order])), start_xywh(polygon(rotated)), atol=0.1
    )


def test_other_region_types_are_refused():
    with pytest.raises(ArgumentError, match="'special'"):
        _start_box(trax.Special.create(1))
