"""A TraX server: the official VOT toolkit asks, a tracker of ours answers."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import TracebackType
from typing import Any

from ssiam.datasets.sequence import image_levels, read_image
from ssiam.errors import MissingExtraError, StreamError, one_line
from ssiam.evaluation.trax_regions import answer, start_box
from ssiam.trackers import StabilizedTracker
from ssiam.video.levels import Levels


def check_trax() -> None:
    """Raise `MissingExtraError` unless vot-trax is installed."""
    if importlib.util.find_spec("trax") is None:
        raise MissingExtraError("a TraX server needs vot-trax: pip install 'ssiam[vot]'")


def serve(tracker: StabilizedTracker) -> None:
    """Answer a TraX client on standard input and output until it quits.

    Call it inside `ssiam.evaluation.trax_channel.protocol_alone`. The client may start the
    tracker as often as it likes, on rectangles or polygons; the confidence is `Track.score`.

    Raises
    ------
    MissingExtraError
        vot-trax is not installed.
    SourceError
        An image is missing or damaged. This and every other error is told to the client as the
        reason of the quit message.
    StreamError
        The client hung up, or sent something that is not the protocol.
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
                tracker.init(image, start_box(start))
                session.reply(start, 1.0)
            else:
                track = tracker.update(image)
                session.reply(answer(track, start), track.score)


class _Session:
    """The conversation with one client; left by an error, it tells the client why."""

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
                "the TraX client hung up, or spoke out of turn (it starts a target before it "
                "sends frames, and ends with quit)"
            ) from None
        return None if request.type == TraxStatus.QUIT else request

    def reply(self, region: Any, confidence: float) -> None:
        """Tell the client where the target is."""
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
