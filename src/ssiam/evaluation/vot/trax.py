"""A TraX server, through which the official VOT toolkit runs a tracker of this package.

The official toolkit draws a polygon with its borders and a rectangle as w by h pixels, so that an
exact rectangle has an overlap of only .95 with a polygon. A target given as a polygon is therefore
reported as polygons whose right and lower corners are the last pixels (x + w - 1), the inverse of
`area_preserving_xywh`. A target given as a rectangle is reported as rectangles.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import cv2
import numpy as np

from ssiam.datasets.images import image_levels, read_image
from ssiam.errors import ArgumentError, MissingExtraError, StreamError, one_line
from ssiam.geometry import corners_from_xywh
from ssiam.track import Track
from ssiam.trackers import StabilizedTracker
from ssiam.video.levels import Levels

_STDOUT, _STDERR = 1, 2
# Environment variable of libtrax: the descriptor to write to in place of standard output.
_OUT_VARIABLE = "TRAX_OUT"


def check_trax() -> None:
    """Raise `MissingExtraError` unless vot-trax is installed."""
    if importlib.util.find_spec("trax") is None:
        raise MissingExtraError("a TraX server needs vot-trax: pip install 'ssiam[vot]'")


def serve(tracker: StabilizedTracker) -> None:
    """Serve a TraX client on standard input and output until it quits.

    Call it inside `reserve_stdout`. The client may start the tracker any number of times, on
    rectangles or polygons; the confidence is `Track.score`.

    Raises
    ------
    MissingExtraError
        vot-trax is not installed.
    SourceError
        An image is missing or damaged. This and every other error is sent to the client as the
        reason of the quit message.
    StreamError
        The client disconnected, or violated the protocol.
    """
    check_trax()
    with _Session() as session:
        start: Any = None
        levels: Levels | None = None
        while (request := session.next()) is not None:
            path = Path(request.image["color"].path())
            if request.objects:
                levels = image_levels(path)
            image = read_image(path, levels)
            if request.objects:
                start = request.objects[0][0]
                tracker.init(image, _start_box(start))
                session.reply(start, 1.0)
            else:
                track = tracker.update(image)
                session.reply(_region_from_track(track, start), track.score)


class _Session:
    """The session with one client; an error inside its block is sent to the client."""

    def __init__(self) -> None:
        import trax

        # Not the "vot" metadata: with it the toolkit starts a new process at every start.
        self._server = trax.Server(
            [trax.Region.RECTANGLE, trax.Region.POLYGON], [trax.Image.PATH], tracker_name="ssiam"
        )

    def next(self) -> Any:
        """The next request to start or to track; None when the client quits."""
        from trax import TraxException, TraxStatus

        try:
            request = self._server.wait()
        except TraxException:
            raise StreamError(
                "the TraX client disconnected, or violated the protocol (it starts a target before "
                "it sends frames, and ends with quit)"
            ) from None
        return None if request.type == TraxStatus.QUIT else request

    def reply(self, region: Any, confidence: float) -> None:
        """Send the target's region to the client."""
        self._server.status([(region, {"confidence": confidence})])

    def __enter__(self) -> _Session:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._server.quit(None if exc is None else one_line(exc))


def _start_box(region: Any) -> list[float]:
    """What a tracker starts on: x, y, w, h of a `trax.Rectangle`, the corners of a `trax.Polygon`.

    Of a polygon with more than four corners, those of its smallest rotated box; pixels.

    Raises
    ------
    ArgumentError
        The region has another type.
    """
    if region.type not in ("rectangle", "polygon"):
        raise ArgumentError(
            f"cannot start on a region of type {region.type!r}: give a rectangle or a polygon"
        )
    if _is_rectangle(region):
        return list(region.bounds())
    points = np.array(list(region), dtype=np.float32)
    if len(points) != 4:
        points = np.asarray(cv2.boxPoints(cv2.minAreaRect(points)))
    return [float(number) for number in points.ravel()]


def _region_from_track(track: Track, start: Any) -> Any:
    """The track as a region of the type of `start`; a rotated box always as a polygon."""
    import trax

    x, y, w, h = track.box
    if track.corners is not None:
        corners = track.corners
    elif _is_rectangle(start):
        return trax.Rectangle.create(x, y, w, h)
    else:
        corners = corners_from_xywh((x, y, w - 1, h - 1))
    return trax.Polygon.create([(float(x), float(y)) for x, y in corners])


def _is_rectangle(region: Any) -> bool:
    return bool(region.type == "rectangle")


@contextmanager
def reserve_stdout() -> Iterator[None]:
    """Reserve standard output for the protocol, in Python and in C, until the process ends.

    Other output is redirected to standard error. The official toolkit reads both through one pipe,
    in which an incomplete line of other output hides the message that follows: if both are the same
    file, other output is discarded, and standard error is restored afterwards.
    """
    sys.stdout.flush()
    os.environ[_OUT_VARIABLE] = str(os.dup(_STDOUT))
    stderr = os.dup(_STDERR)
    if os.path.sameopenfile(_STDOUT, _STDERR):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, _STDERR)
        os.close(null)
    os.dup2(_STDERR, _STDOUT)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(stderr, _STDERR)
        os.close(stderr)
