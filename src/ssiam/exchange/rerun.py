"""`RerunLog`: frames, boxes and camera motion as a recording for the Rerun viewer."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from pathlib import Path
from threading import Thread
from typing import Any, Final

import cv2
import numpy as np

from ssiam.copying import NotCopyable
from ssiam.errors import ArgumentError, MissingExtraError, SinkError
from ssiam.exchange.detections import has_box
from ssiam.geometry import Image
from ssiam.motion import Motion
from ssiam.outputs import ClosedOnExit, PartFile
from ssiam.track import Track

_APPLICATION: Final = "ssiam"
_IMAGE: Final = "camera/image"
_BOXES: Final = "camera/targets"
_OUTLINES: Final = "camera/outlines"
_FILE_DESCRIPTORS: Final = Path("/dev/fd")
_CHUNK: Final = 1 << 20  # bytes


class RerunLog(NotCopyable, ClosedOnExit):
    """Writes an .rrd file, which ``rerun FILE.rrd`` displays; a context manager.

    Threads: one thread at a time.

    The timelines are ``frame`` (from 0) and ``time`` (seconds). The entities:

    - ``camera/image``: the frame.
    - ``camera/targets``: boxes of the targets that are not lost, with their names as labels and
      their numbers as class ids.
    - ``camera/outlines``: rotated boxes of mask trackers.
    - ``targets/N/score`` and ``targets/N/lost`` (0 or 1).
    - ``motion/dx``, ``motion/dy`` (pixels) and ``motion/angle`` (radians): the camera motion since
      the previous frame, at the image center.

    The file grows as ``NAME.part.rrd``, which `close` renames, also after Ctrl-C or an exception.
    No viewer is started and nothing is sent over the network.

    Parameters
    ----------
    path : str or Path
        The file, .rrd. Its folder must exist.
    quality : int
        JPEG quality of the images, 1 to 100.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    MissingExtraError
        rerun-sdk is not installed.
    SinkError
        The file cannot be written, on construction or later, or exists and `overwrite` is False.
    """

    def __init__(self, path: str | Path, quality: int = 80, *, overwrite: bool = True) -> None:
        self._stream = _RerunStream(Path(path), overwrite=overwrite)
        self._quality = quality
        self._has_outlines = False

    def write(
        self,
        index: int,
        time: float | None,
        image: Image,
        tracks: Sequence[Track],
        names: Sequence[str],
        ids: Sequence[int] | None = None,
    ) -> None:
        """Log one frame.

        Parameters
        ----------
        index : int
            Frame number, from 0.
        time : float or None
            Seconds; None if unknown.
        image : (H, W, 3) uint8
            BGR.
        tracks : sequence of Track
            Raw-frame pixels.
        names : sequence of str
            One per track.
        ids : sequence of int, optional
            Number of each track's target; 1, 2, ... by default.

        Raises
        ------
        ArgumentError
            `tracks`, `names` and `ids` differ in length.
        """
        numbers = list(range(1, len(tracks) + 1)) if ids is None else list(ids)
        if not len(names) == len(numbers) == len(tracks):
            raise ArgumentError(
                f"{len(tracks)} tracks with {len(names)} names and {len(numbers)} ids: "
                "give one name and one id per track"
            )
        self._stream.set_time(index, time)
        self._log_image(image)
        self._log_boxes(tracks, names, numbers)
        for track, number in zip(tracks, numbers, strict=True):
            self._stream.log_number(f"targets/{number}/score", track.score)
            self._stream.log_number(f"targets/{number}/lost", float(track.lost))
        if tracks and tracks[0].motion is not None:
            self._log_motion(tracks[0].motion)

    def close(self) -> None:
        """Finish the file. May be called twice."""
        self._stream.close()

    def _log_image(self, image: Image) -> None:
        _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self._quality])
        encoded = self._stream.rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg")
        self._stream.log(_IMAGE, encoded)

    def _log_boxes(
        self, tracks: Sequence[Track], names: Sequence[str], numbers: Sequence[int]
    ) -> None:
        """Log the boxes of this frame, even if empty: the viewer keeps the last logged value."""
        rr = self._stream.rr
        visible = [i for i, track in enumerate(tracks) if has_box(track)]
        boxes = rr.Boxes2D(
            array=np.array([tracks[i].box for i in visible]).reshape(-1, 4),
            array_format=rr.Box2DFormat.XYWH,
            labels=[names[i] for i in visible],
            class_ids=[numbers[i] for i in visible],
        )
        self._stream.log(_BOXES, boxes)
        corners = [tracks[i].corners for i in visible]
        outlines = [np.vstack([each, each[:1]]) for each in corners if each is not None]
        self._has_outlines |= bool(outlines)
        if self._has_outlines:
            ids = [numbers[i] for i in visible if tracks[i].corners is not None]
            self._stream.log(_OUTLINES, rr.LineStrips2D(outlines, class_ids=ids))

    def _log_motion(self, motion: Motion) -> None:
        dx, dy, angle = motion.shift_angle
        for name, value in (("dx", dx), ("dy", dy), ("angle", angle)):
            self._stream.log_number(f"motion/{name}", value)


class _RerunStream:
    """An .rrd file written through the Rerun SDK, any version from 0.20.

    Parameters
    ----------
    path : Path
        The file. It grows as ``NAME.part.rrd``, which `close` renames.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    MissingExtraError
        The SDK is not installed.
    SinkError
        On construction, logging or closing: the file cannot be written, or exists and `overwrite`
        is False.
    """

    def __init__(self, path: Path, *, overwrite: bool = True) -> None:
        try:
            self.rr: Any = importlib.import_module("rerun")
        except ImportError as error:
            raise MissingExtraError(
                f"a recording for Rerun needs its SDK ({error}): pip install 'ssiam[rerun]'"
            ) from error
        if path.suffix.lower() != ".rrd":
            raise SinkError(f"{path}: a recording for Rerun is written as .rrd")
        self._part = PartFile(path, overwrite=overwrite)
        # Version 0.23 renamed several functions.
        self._is_recent = hasattr(self.rr, "Scalars")
        open_recording = self.rr.RecordingStream if self._is_recent else self.rr.new_recording
        self._recording: Any = open_recording(_APPLICATION)
        self._copy = _PipeCopy(self._part.file) if _FILE_DESCRIPTORS.is_dir() else None
        self._save()

    def set_time(self, frame: int, time: float | None) -> None:
        """Set the time of everything logged from now on: frame from 0, seconds if known."""
        self._recording.reset_time()
        if self._is_recent:
            self._recording.set_time("frame", sequence=frame)
            if time is not None:
                self._recording.set_time("time", duration=time)
            return
        self._recording.set_time_sequence("frame", frame)
        if time is not None:
            self._recording.set_time_seconds("time", time)

    def log(self, entity: str, value: Any) -> None:
        """Log one of the SDK's archetypes (`rr`) under the path `entity`."""
        if self._copy is not None and self._copy.error is not None:
            raise self._part.error(self._copy.error) from self._copy.error
        self._recording.log(entity, value, strict=True)

    def log_number(self, entity: str, value: float) -> None:
        """Log a number that is plotted over time."""
        self.log(entity, (self.rr.Scalars if self._is_recent else self.rr.Scalar)(value))

    def close(self) -> None:
        """Finish the file. May be called twice."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        recording.disconnect()
        if self._copy is not None:
            self._copy.finish()
            if self._copy.error is not None:
                raise self._part.error(self._copy.error) from self._copy.error
        try:
            self._part.finish()
        except OSError as error:
            raise self._part.error(error) from error

    def _save(self) -> None:
        try:
            self._recording.save(str(self._part.file if self._copy is None else self._copy.entry))
        except RuntimeError as error:
            self._part.discard()
            raise self._part.error(error) from error
        finally:
            if self._copy is not None:
                self._copy.close_own_end()


class _PipeCopy:
    """A pipe whose bytes a thread writes to a file.

    The SDK does not report a failed write and hangs from then on: a full disk would stop the
    program. Writing to the pipe never fails.

    Attributes
    ----------
    entry : Path
        The write end, which the SDK opens like a file.
    error : OSError or None
        The failed write to the file, if there was one.
    """

    def __init__(self, path: Path) -> None:
        self._source, self._sink = os.pipe()
        self.entry = _FILE_DESCRIPTORS / str(self._sink)
        self.error: OSError | None = None
        self._thread = Thread(target=self._run, args=(path,), name="rerun-file", daemon=True)
        self._thread.start()

    def close_own_end(self) -> None:
        """Close this write end, once the SDK has opened its own; the pipe ends with that one."""
        os.close(self._sink)

    def finish(self) -> None:
        """Wait until everything is written to the file."""
        self._thread.join()

    def _run(self, path: Path) -> None:
        try:
            with path.open("wb") as file:
                while chunk := os.read(self._source, _CHUNK):
                    file.write(chunk)
        except OSError as error:
            self.error = error
        while os.read(self._source, _CHUNK):  # after an error: the SDK must not wait
            pass
        os.close(self._source)
