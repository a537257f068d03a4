"""`open_feed`: the frames of a live session, from whatever delivers them."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Literal, Protocol

from ssiam.video import Source, open_source
from ssiam.video.levels import Levels
from ssiam.video.sources import STDIN, camera_index, is_address, open_address, redact_address
from ssiam.web.errors import Note
from ssiam.web.feeds.newest import Arrival, FeedState
from ssiam.web.feeds.pacing import PacedFeed
from ssiam.web.feeds.pipe import is_piped, open_pipe
from ssiam.web.feeds.pushed import PushedFeed
from ssiam.web.feeds.reconnecting import ReconnectingFeed

__all__ = ["BROWSER", "Arrival", "Feed", "open_feed"]

BROWSER = "browser"

# Schemes of servers that send at their own pace even what has an end.
_STREAMING = ("rtsp", "rtsps", "rtmp", "rtmps")
# Playlists: their frames come by the segment, many seconds at once.
_PLAYLISTS = (".m3u8", ".mpd")
# Seconds without anything after which a stream counts as gone; they pass twice where FFmpeg, as
# for H.264, keeps the last picture back until it knows that it is whole.
_SILENCE = 2.0


class Feed(Protocol):
    """Where a live session takes its frames from: always the newest, never a queue."""

    @property
    def name(self) -> str:
        """The source as messages call it; never holds a password."""

    @property
    def size_wh(self) -> tuple[int, int] | None:
        """Width and height in pixels, as they are now; None as long as they are unknown."""

    @property
    def fps(self) -> float | None:
        """Frames a second as announced, or as measured of a browser; None if unknown."""

    @property
    def pixel_aspect(self) -> Fraction:
        """Width of a pixel by its height, as it is to be shown."""

    @property
    def length(self) -> int | None:
        """Announced number of frames; None for what has no end."""

    @property
    def seekable(self) -> bool:
        """Whether `restart` works."""

    @property
    def state(self) -> FeedState:
        """What it is doing; it has ended when its last frame has been taken."""

    @property
    def dropped(self) -> int:
        """Frames left out for newer ones since the beginning; none of those while paused."""

    def take(self, timeout: float) -> Arrival | None:
        """The newest frame not yet taken; None if none came for `timeout` seconds, or if closed."""

    def pause(self, paused: bool) -> None:
        """Stand still (True) or go on (False)."""

    def advance(self) -> None:
        """Let one more frame through while paused: of a file the next, else the newest."""

    def restart(self) -> None:
        """Begin again with frame 0, also after the end; while paused, that one is let through.

        Raises
        ------
        CommandError
            It is not `seekable`.
        SourceError
            It cannot be opened any more.
        """

    def close(self) -> None:
        """Let go of the source and end its thread. May be called twice."""


def open_feed(
    spec: str,
    *,
    pace: Literal["clock", "fast"] = "clock",
    notes: Callable[[Note], None],
    stream: int | None = None,
    levels: tuple[float, float] | None = None,
) -> Feed:
    """The feed of a source.

    Parameters
    ----------
    spec : str
        As `open_source` takes it, or ``"browser"`` for a `PushedFeed`.
    pace : {"clock", "fast"}
        Whether a recording plays at its own pace, and frames that nobody takes are dropped, or
        each waits until it is taken. Cameras and streams have only their own pace.
    notes : callable
        Told what happens to the source, on a thread of the feed's.
    stream : int or None
    levels : (low, high) or None
        Both as `open_source` takes them.

    Raises
    ------
    SourceError
        It cannot be opened.
    """
    if spec == BROWSER:
        return PushedFeed(BROWSER)
    if spec == STDIN and is_piped():
        source, stop = open_pipe(stream, levels)
        return PacedFeed(source, notes, in_step=pace == "fast", stop=stop)
    reopen = partial(_open, spec, stream, levels)
    source = reopen()
    if _is_live(spec, source):
        return ReconnectingFeed(source, notes, reopen, in_bursts=_is_playlist(spec))
    again = None if spec == STDIN else reopen
    return PacedFeed(source, notes, reopen=again, in_step=pace == "fast")


def _open(spec: str, stream: int | None, levels: tuple[float, float] | None) -> Source:
    if not _is_remote(spec) or _is_playlist(spec):
        return open_source(spec, stream=stream, levels=levels)
    chosen = None if levels is None else Levels(*levels)
    return open_address(spec, read_timeout=_SILENCE, stream=stream, levels=chosen)


def _is_live(spec: str, source: Source) -> bool:
    """Whether it goes on without us; files and pipes wait."""
    if not _is_remote(spec):
        return camera_index(spec) is not None
    return source.length is None or _scheme(spec) in _STREAMING


def _is_remote(spec: str) -> bool:
    return is_address(spec) and _scheme(spec) != "file"


def _is_playlist(spec: str) -> bool:
    return is_address(spec) and redact_address(spec).lower().endswith(_PLAYLISTS)


def _scheme(address: str) -> str:
    return address.partition("://")[0].lower()
