"""`OutputFiles`: writes a live session's video and results to files that the user named."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from queue import Queue
from typing import Final

from ssiam.errors import SsiamError, one_line
from ssiam.outputs import ClosedOnExit
from ssiam.video import Frame, ResultSink, VideoSink, draw_tracks, open_results
from ssiam.video.results import Row
from ssiam.web.session import Session
from ssiam.web.types import Note, Step

_UNKNOWN_FPS: Final = 30.0  # of sources that state no rate; their frames have times
_MOST_WAITING: Final = 8  # steps; a slower disk slows down the tracking, and the feed drops frames


class OutputFiles(ClosedOnExit):
    """Writes each frame of a session once, from the beginning, on a separate thread.

    The files are finished under their names by `close`, also after an exception.

    Parameters
    ----------
    session : Session
        Not started yet.
    video : Path, optional
        Video with the targets drawn in; see `VideoSink`.
    results : Path, optional
        .csv, .jsonl, or ``-`` for JSON lines on standard output; a row for each target that is
        tracked in a frame.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    SinkError
        A file cannot be written, or exists and `overwrite` is False.
    """

    def __init__(
        self,
        session: Session,
        video: Path | None = None,
        results: Path | None = None,
        *,
        overwrite: bool = False,
    ) -> None:
        self.error: Exception | None = None
        self._session = session
        self._video: VideoSink | None = None
        self._results: ResultSink | None = None
        with ExitStack() as stack:
            if results is not None:
                self._results = stack.enter_context(open_results(results, overwrite=overwrite))
            if video is not None:
                info = session.info
                self._video = stack.enter_context(
                    VideoSink(
                        video,
                        Fraction(info.fps or _UNKNOWN_FPS).limit_denominator(1001),
                        pixel_aspect=info.pixel_aspect,
                        is_variable=True,
                        overwrite=overwrite,
                    )
                )
            self._sinks = stack.pop_all()
        self._queue: Queue[Step | None] = Queue(_MOST_WAITING)
        self._last_frame: Frame | None = None
        self._thread = threading.Thread(target=self._run, name="ssiam-outputs", daemon=True)
        self._thread.start()
        self._unlisten = session.listen(self._put)

    def close(self) -> None:
        """Finish the files. May be called twice.

        Raises
        ------
        Exception
            The error that ended the writing, if `error` was not None before.
        """
        self._unlisten()
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def _put(self, step: Step) -> None:
        """Queue a step, on the session's thread; steps that repeat a frame are ignored."""
        if step.frame is not self._last_frame:
            self._last_frame = step.frame
            self._queue.put(step)

    def _run(self) -> None:
        try:
            with self._sinks:
                while (step := self._queue.get()) is not None:
                    self._write(step)
            return
        except Exception as error:
            self.error = error
            if isinstance(error, SsiamError):
                self._session.notify(Note("error", f"the outputs have ended: {one_line(error)}"))
        while self._queue.get() is not None:
            pass  # the session's thread must not wait for a writer that has ended

    def _write(self, step: Step) -> None:
        tracks = [target.track for target in step.targets]
        if self._results is not None:
            for target in step.targets:
                row = Row(step.frame.index, step.frame.time, target.id, target.track)
                self._results.write_row(row)
        if self._video is not None:
            numbers = [target.id for target in step.targets]
            drawn = draw_tracks(step.frame.image, tracks, numbers=numbers)
            self._video.write(drawn, step.frame.time)
