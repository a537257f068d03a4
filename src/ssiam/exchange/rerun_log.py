"""`RerunLog`: frames, boxes and the camera's motion as a recording for Rerun's viewer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from ssiam.copying import NotCopyable
from ssiam.errors import ArgumentError
from ssiam.exchange.rerun_stream import RerunStream
from ssiam.geometry import Image
from ssiam.motion import Motion
from ssiam.outputs import ClosedOnExit
from ssiam.track import Track

_IMAGE: Final = "camera/image"
_BOXES: Final = "camera/targets"
_OUTLINES: Final = "camera/outlines"


class RerunLog(NotCopyable, ClosedOnExit):
    """Writes an .rrd file, which ``rerun FILE.rrd`` shows; a context manager.

    Threads: one thread at a time.

    The timelines are ``frame`` (from 0) and ``time`` (seconds). ``camera/image`` is the picture,
    ``camera/targets`` the boxes of the targets that are not lost, with names and, as class ids,
    their numbers; ``camera/outlines`` the rotated boxes of mask trackers;
    ``targets/N/score`` and ``targets/N/lost`` (0 or 1); ``motion/dx``, ``motion/dy`` (pixels) and
    ``motion/angle`` (radians) the camera's motion since the frame before, at the picture's centre.

    The file grows as ``NAME.part.rrd``, which `close` renames, also after Ctrl-C or an exception.
    No viewer is started and nothing is sent anywhere.

    Parameters
    ----------
    path : str or Path
        The file, .rrd. Its folder must exist.
    quality : int
        Of the JPEG pictures, 1 to 100.
    overwrite : bool
        Whether a file of that name may be replaced.

    Raises
    ------
    MissingExtraError
        rerun-sdk is not installed.
    SinkError
        The file cannot be written, on construction or later, or exists and is not to be replaced.
    """

    def __init__(self, path: str | Path, quality: int = 80, *, overwrite: bool = True) -> None:
        self._stream = RerunStream(Path(path), overwrite=overwrite)
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
            Number of the frame, from 0.
        time : float or None
            Seconds; None if unknown.
        image : (H, W, 3) uint8
            BGR.
        tracks : sequence of Track
            Raw-frame pixels.
        names : sequence of str
            One a track.
        ids : sequence of int, optional
            Number of each track's target; 1, 2, ... unless given.
        """
        numbers = list(range(1, len(tracks) + 1)) if ids is None else list(ids)
        if not len(names) == len(numbers) == len(tracks):
            raise ArgumentError(
                f"{len(tracks)} tracks with {len(names)} names and {len(numbers)} ids: "
                "give one of each a track"
            )
        self._stream.at(index, time)
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
        picture = self._stream.rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg")
        self._stream.log(_IMAGE, picture)

    def _log_boxes(
        self, tracks: Sequence[Track], names: Sequence[str], numbers: Sequence[int]
    ) -> None:
        """The boxes of this frame, also if there are none: the last ones would stay."""
        rr = self._stream.rr
        shown = [place for place, track in enumerate(tracks) if _has_box(track)]
        boxes = rr.Boxes2D(
            array=np.array([tracks[place].box for place in shown]).reshape(-1, 4),
            array_format=rr.Box2DFormat.XYWH,
            labels=[names[place] for place in shown],
            class_ids=[numbers[place] for place in shown],
        )
        self._stream.log(_BOXES, boxes)
        corners = [tracks[place].corners for place in shown]
        outlines = [np.vstack([each, each[:1]]) for each in corners if each is not None]
        self._has_outlines |= bool(outlines)
        if self._has_outlines:
            ids = [numbers[place] for place in shown if tracks[place].corners is not None]
            self._stream.log(_OUTLINES, rr.LineStrips2D(outlines, class_ids=ids))

    def _log_motion(self, motion: Motion) -> None:
        dx, dy, angle = motion.shift_angle
        for name, value in (("dx", dx), ("dy", dy), ("angle", angle)):
            self._stream.log_number(f"motion/{name}", value)


def _has_box(track: Track) -> bool:
    return not track.lost and bool(np.isfinite(track.box).all())
