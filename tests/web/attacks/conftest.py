"""Servers under attack: hostile clients are refused or disconnected, and no other is affected.

In every test a well-behaved client is connected too, and must receive steps at the usual rate.
"""

import pytest

from helpers.live_clients import Watcher
from helpers.live_server import serving, until


@pytest.fixture(scope="module")
def served():
    with serving() as live:
        watcher = Watcher(live)
        yield live, watcher
        watcher.close()


@pytest.fixture
def live(served):
    """A server whose other client must not be disturbed by the test."""
    live, watcher = served
    with watcher.undisturbed():
        yield live
    until(lambda: live.clients == 1)


@pytest.fixture
def token(live):
    return live.server.access.token
