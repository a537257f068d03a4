"""The page on which targets are chosen, with a run as that of `ssiam track`."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from dataclasses import dataclass, field

import ssiam
from helpers.live_server import SECONDS, Live
from ssiam.errors import SsiamError
from ssiam.geometry import IDENTITY
from ssiam.video import Source, open_source
from ssiam.web.picking.page import PickPage
from ssiam.web.server.limits import ServerLimits


def square_around(image, point_xy):
    """A proposal without networks."""
    x, y = point_xy
    return x - 10.0, y - 10.0, 20.0, 20.0
