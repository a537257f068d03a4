"""Servers under attack: whoever means no good is refused or dropped, and nobody else notices.

In every test a good client is connected all along, and is sent the session's steps at their rate.
"""

import pytest

from helpers.live_clients import Watcher
from helpers.live_server import serving, until


@pytest.fixture(scope="module")
def served():
    with serving(needs_token=True) as live:
        watcher = Watcher(live)
        yield live, watcher
        watcher.close()


@pytest.fixture
def live(served):
    """A server that must not be disturbed by what the test does."""
    live, watcher = served
    with watcher.undisturbed():
        yield live
    until(lambda: live.clients == 1)


@pytest.fixture
def token(live):
    return live.server.access.token
