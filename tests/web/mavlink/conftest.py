import pytest

from helpers.ground_station import IDLE, GroundStation
from helpers.scripted_session import ScriptedSession
from ssiam.web.mavlink.camera import MavlinkCamera


@pytest.fixture
def session():
    with ScriptedSession() as session:
        yield session


@pytest.fixture
def station():
    with GroundStation() as station:
        yield station


@pytest.fixture
def connected(session, station):
    """A session with one step, and a station that receives its status."""
    with MavlinkCamera(session, station.address):
        session.step()
        assert station.status().tracking_status == IDLE
        yield session, station
