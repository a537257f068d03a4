import pytest

from helpers.live_clients import Client
from helpers.live_server import serving


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    with serving(recordings=tmp_path_factory.mktemp("recordings")) as live:
        yield live


@pytest.fixture
def client(live):
    with Client(live) as client:
        yield client
