"""`with_following`: each frame together with the one after it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ssiam.video.frames import Frame


def with_following(frames: Iterable[Frame]) -> Iterator[tuple[Frame, Frame | None]]:
    """Frames, each with the next one where there is one.

    What goes wrong with a frame is raised after the one before it has been delivered, without a
    next one. A camera's frames come a frame later this way: it is meant for files.
    """
    upcoming = iter(frames)
    current = next(upcoming, None)
    while current is not None:
        try:
            following = next(upcoming, None)
        except Exception:
            yield current, None
            raise
        yield current, following
        current = following
