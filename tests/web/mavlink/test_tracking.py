"""Targets of a ground station, and the status that it receives."""

import math

import pytest
from pymavlink.dialects.v20 import common as mavlink

from helpers.ground_station import ACCEPTED, ACTIVE, ERROR, IDLE, POINT, RECTANGLE, SECONDS, STOP
from helpers.scripted_session import SIZE
from ssiam.web.types import Add, Remove

IN_STATUS = mavlink.CAMERA_TRACKING_TARGET_DATA_IN_STATUS


def rectangle(status):
    """(x, y, w, h) in pixels."""
    (left, right), (top, bottom) = (
        [fraction * size for fraction in fractions]
        for fractions, size in zip(
            [(status.rec_top_x, status.rec_bottom_x), (status.rec_top_y, status.rec_bottom_y)],
            SIZE,
            strict=True,
        )
    )
    return pytest.approx((left, top, right - left, bottom - top), abs=1e-3)


def test_a_rectangle_is_tracked_and_the_status_sent_at_every_step(connected):
    session, station = connected
    assert station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75) == ACCEPTED
    assert session.submitted == [Add((160, 180, 80, 90))]
    for shift in range(20):
        box = (160 + 7.5 * shift, 180 - 3.25 * shift, 80 + shift, 90)
        session.set_target(1, box)
        session.step()
        status = station.status()
        assert status.tracking_status == ACTIVE
        assert status.tracking_mode == mavlink.CAMERA_TRACKING_MODE_RECTANGLE
        assert status.target_data == IN_STATUS
        assert rectangle(status) == box
        center = status.point_x * SIZE[0], status.point_y * SIZE[1]
        assert center == pytest.approx((box[0] + box[2] / 2, box[1] + box[3] / 2), abs=1e-3)
        assert math.isnan(status.radius)


def test_a_box_is_clipped_to_the_frame(connected):
    session, station = connected
    session.set_target(1, (-20, 300, 80, 90))
    session.step()
    assert rectangle(station.status(lambda s: s.tracking_status)) == (0, 300, 60, 60)


POINTS = [
    # name, x, y, radius, the box in pixels
    ("in the middle", 0.5, 0.5, 0.1, (256, 116, 128, 128)),
    ("without a radius", 0.5, 0.5, 0, (304, 164, 32, 32)),
    ("at the edge", 0, 1, 0.1, (0, 296, 64, 64)),
]


@pytest.mark.parametrize(
    ("x", "y", "radius", "box"), [p[1:] for p in POINTS], ids=[p[0] for p in POINTS]
)
def test_a_point_is_tracked_as_the_square_around_it(connected, x, y, radius, box):
    session, station = connected
    assert station.ask(POINT, x, y, radius) == ACCEPTED
    assert session.submitted[0].xywh == pytest.approx(box, abs=1e-4)
    session.step()
    status = station.status()
    assert (status.tracking_status, status.tracking_mode) == (ACTIVE, 1)
    assert status.point_x == pytest.approx((box[0] + box[2] / 2) / SIZE[0])
    assert status.point_y == pytest.approx((box[1] + box[3] / 2) / SIZE[1])
    assert status.radius == pytest.approx(box[2] / 2 / SIZE[0])


def test_the_status_of_a_lost_target_has_no_position(connected):
    session, station = connected
    station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75)
    session.set_target(1, (1, 2, 30, 40), lost=True)
    session.step()
    status = station.status()
    assert (status.tracking_status, status.target_data) == (ERROR, 0)
    assert math.isnan(status.point_x)
    assert math.isnan(status.rec_top_x)
    session.set_target(1, (1, 2, 30, 40))
    session.step()
    assert station.status().tracking_status == ACTIVE


def test_stop_removes_the_target(connected):
    session, station = connected
    station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75)
    session.step()
    assert station.status().tracking_status == ACTIVE
    assert station.ask(STOP) == ACCEPTED
    assert session.submitted[1:] == [Remove(1)]
    session.step()
    status = station.status()
    assert (status.tracking_status, status.tracking_mode, status.target_data) == (IDLE, 0, 0)
    assert station.ask(STOP) == ACCEPTED
    assert len(session.submitted) == 2


def test_targets_of_others_are_reported_and_kept(connected):
    session, station = connected
    session.set_target(1, (10, 20, 30, 40))
    session.step()
    assert rectangle(station.status()) == (10, 20, 30, 40)
    assert station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75) == ACCEPTED
    session.step()
    assert rectangle(station.status()) == (160, 180, 80, 90)
    assert station.ask(STOP) == ACCEPTED
    session.step()
    assert rectangle(station.status()) == (10, 20, 30, 40)
    assert set(session.targets) == {1}


def test_stop_after_another_client_removed_the_target(connected):
    session, station = connected
    station.ask(RECTANGLE, 0.25, 0.5, 0.375, 0.75)
    session.step()
    assert station.status().tracking_status == ACTIVE
    session.submit(Remove(1)).result(SECONDS)
    session.step()
    assert station.status().tracking_status == IDLE
    assert station.ask(STOP) == ACCEPTED
