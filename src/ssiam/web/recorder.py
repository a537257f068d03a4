"""`Recorder`: one recording, written on a thread of its own."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

from ssiam.errors import SinkError, SsiamError
from ssiam.exchange import ExportKind, read_annotations, write_exports
from ssiam.video import ResultSink, VideoSink, draw_tracks, open_results
from ssiam.video.layouts import Row
from ssiam.web.backlog import Backlog
from ssiam.web.step import Step

_log = logging.getLogger(__name__)

_VIDEO, _TABLES = "video.mp4", ("results.csv", "results.jsonl")
_EXPORTS: Final[dict[str, ExportKind]] = {
    "cvat.xml": "cvat",
    "coco.json": "coco",
    "labelstudio.json": "labelstudio",
    "got10k.zip": "got10k",
}
# Parts are what a full disk leaves.
FILES: Final = (
    *(_VIDEO, *_TABLES, *_EXPORTS),
    *("video.part.mp4", "results.part.csv", "results.part.jsonl"),
)
_SQUARE: Final = Fraction(1)
_LONGEST: Final = 30 * 60 * 60  # frames: an hour at 30 a second


class Recorder:
    """Writes steps as a video with the targets drawn in, and as results.

    Frames are numbered as they are in the video. A frame that is told of twice, as while the
    source is paused, is written once.

    Parameters
    ----------
    folder : Path
        Made for it.
    fps : float
        Of frames that have no time.
    changed : callable
        Called when the recording is complete.
    pixel_aspect : Fraction
        Width of a pixel by its height, as players are to show it.

    Raises
    ------
    SinkError
        The folder or a file in it cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        fps: float,
        changed: Callable[[], None],
        pixel_aspect: Fraction = _SQUARE,
    ) -> None:
        try:
            folder.mkdir()
        except OSError as error:
            raise SinkError(f"{folder} cannot be made: {error.strerror or error}") from error
        self.folder, self.name = folder, folder.name
        self.is_open = True
        self._fps, self._changed = Fraction(fps or 30).limit_denominator(1001), changed
        self._frames, self._seconds = 0, 0.0
        self._names: dict[int, str] = {}
        self._size_wh = (0, 0)
        self._backlog = Backlog()
        with ExitStack() as stack:
            self._video = stack.enter_context(
                VideoSink(folder / _VIDEO, self._fps, pixel_aspect=pixel_aspect)
            )
            self._tables: list[ResultSink] = [
                stack.enter_context(open_results(folder / name)) for name in _TABLES
            ]
            self._sinks = stack.pop_all()
        self._thread = threading.Thread(target=self._run, name="ssiam-recorder", daemon=True)
        self._thread.start()

    def write(self, step: Step) -> bool:
        """Take in a step, at once; False when no more can be taken and the recording has ended."""
        if not self.is_open or self._frames >= _LONGEST:
            self.end()
            return False
        if not self._backlog.add(step):
            _log.warning("recording %s: a frame is left out, the disk is too slow", self.name)
        return True

    def end(self) -> None:
        """Let the thread finish what it has."""
        self._backlog.end()

    def join(self) -> None:
        """Wait until everything is written."""
        self._thread.join()

    def summary(self) -> dict[str, Any]:
        """Name, frames, seconds, whether it is open, its files."""
        written = [] if self.is_open else [f for f in FILES if (self.folder / f).exists()]
        return {
            "name": self.name,
            "frames": self._frames,
            "seconds": round(self._seconds, 3),
            "open": self.is_open,
            "files": written,
        }

    def _run(self) -> None:
        try:
            with self._sinks:
                for step in self._backlog:
                    self._add(step)
            self._export()
        except SsiamError as error:
            _log.error("recording %s ends: %s", self.name, error)
        self.is_open = False
        self._changed()

    def _add(self, step: Step) -> None:
        frame, targets = step.frame, step.targets
        height, width = frame.image.shape[:2]
        self._size_wh = (width, height)
        tracks = [target.track for target in targets]
        drawn = draw_tracks(frame.image, tracks, numbers=[target.id for target in targets])
        # Times are those of the recorded video, not of the session.
        time = self._video.write(drawn, frame.time)
        for target in targets:
            self._names[target.id] = target.name
            row = Row(self._frames, time, target.id, target.track)
            for table in self._tables:
                table.write_row(row)
        self._frames += 1
        self._seconds = (time or 0.0) + 1 / float(self._fps)

    def _export(self) -> None:
        """Write what other programs read."""
        if not self._names:
            return
        names = [self._names.get(n, f"target {n}") for n in range(1, max(self._names) + 1)]
        table = self.folder / _TABLES[0]
        rows = read_annotations(table, self._size_wh, self._fps, names)
        annotations = replace(rows, length=self._frames)
        for file, kind in _EXPORTS.items():
            write_exports(annotations, self.folder / file, kind)
