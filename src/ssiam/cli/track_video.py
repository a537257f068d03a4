"""`TrackVideo`: the video of `ssiam track`, with overlay and virtual camera."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from ssiam.cli.track_views import VideoOptions, Views, first_box
from ssiam.geometry import Image, Points, map_points
from ssiam.motion import Motion
from ssiam.render import CameraView, Renderer, ShakeMeter
from ssiam.track import Track
from ssiam.video import Frame, Source, VideoSink, draw_tracks, side_by_side

_TRAIL_SECONDS: Final = 2.0


class TrackVideo:
    """Draws the tracks, renders the views and writes the video.

    Targets are drawn after the warp, so that lines and letters are not warped.

    Parameters
    ----------
    path : Path
    source : Source
        Its rate, pixel aspect and sound are kept.
    options : VideoOptions
    views : Views
    targets : int
        Number of targets.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    SinkError
        On construction or writing: the video cannot be written.
    """

    def __init__(
        self,
        path: Path,
        source: Source,
        options: VideoOptions,
        views: Views,
        *,
        targets: int,
        overwrite: bool,
    ) -> None:
        info = source.info
        self._options = options
        self._views = views
        self._renderer = Renderer(options.border)
        fps = float(source.fps)
        self._trails = [_Trail(max(2, round(_TRAIL_SECONDS * fps))) for _ in range(targets)]
        self._shake_before, self._shake_after = ShakeMeter(fps), ShakeMeter(fps)
        self._prev_view: CameraView | None = None
        self.sink = VideoSink(
            path,
            source.fps,
            overwrite=overwrite,
            pixel_aspect=info.pixel_aspect,
            is_variable=info.is_variable,
            sound=info.sound,
        )

    def write(
        self,
        frame: Frame,
        tracks: Sequence[Track | None],
        motion: Motion | None = None,
        fps: float | None = None,
    ) -> None:
        """Write one frame.

        Parameters
        ----------
        frame : Frame
        tracks : sequence of Track or None
            Of each target, raw-frame pixels; None for those that have not begun.
        motion : Motion, optional
            Camera motion to this frame.
        fps : float, optional
            Frames per second, to be drawn.
        """
        view = self._views.of(frame, motion, first_box(tracks))
        for trail, track in zip(self._trails, tracks, strict=True):
            trail.add(track, motion)
        if self._options.is_virtual:
            self._measure(view, motion)
            shown = self._renderer.render(frame.image, view, motion)
            image = self._drawn(shown, view, tracks, fps)
        else:
            image = self._drawn(frame.image, view, tracks, fps)
        if self._options.side_by_side:
            raw = CameraView.raw((frame.image.shape[1], frame.image.shape[0]))
            raw_image = self._drawn(frame.image, raw, tracks, fps)
            image = side_by_side(raw_image, image, self._options.chosen_view)
        self.sink.write(image, frame.time)

    def _drawn(
        self, image: Image, view: CameraView, tracks: Sequence[Track | None], fps: float | None
    ) -> Image:
        """The tracks, drawn into a copy of an image of `view`."""
        overlay = self._options.overlay
        if overlay == "none":
            return image
        begun = {number: track for number, track in enumerate(tracks, 1) if track is not None}
        return draw_tracks(
            image,
            [_mapped(track, view) for track in begun.values()],
            fps=fps if overlay == "box+score" else None,
            numbers=list(begun) if len(tracks) > 1 else None,
            overlay=overlay,
            trails=[
                map_points(view.out_from_raw, self._trails[number - 1].points) for number in begun
            ],
        )

    def _measure(self, view: CameraView, motion: Motion | None) -> None:
        """Add the motions of raw and written image to the shake meters."""
        prev, self._prev_view = self._prev_view, view
        if prev is None or motion is None or not motion.reliable:
            return
        self._shake_before.add(motion.cur_from_prev, motion.size_wh)
        out_motion = view.out_from_raw @ motion.cur_from_prev @ np.linalg.inv(prev.out_from_raw)
        self._shake_after.add(out_motion, view.size_wh)

    @property
    def notes(self) -> list[str]:
        """View, omitted sound and omitted frames, one line each; complete after the end."""
        no_sound, dropped = self.sink.sound_omitted, self.sink.dropped_frames
        lines = [f"video: has no sound: {no_sound}"] if no_sound else []
        if dropped:
            lines.append(
                f"video: {dropped} frames are omitted, because they come faster than the fixed "
                "rate of an AVI; write .mp4 or .mkv to keep them"
            )
        if self._options.is_virtual:
            before, after = self._shake_before.px_per_frame, self._shake_after.px_per_frame
            lines.append(
                f"view: {self._options.chosen_view}, {self._views.note}; it shakes by "
                f"{after:.2f} px per frame, the raw frame by {before:.2f} px"
            )
        return lines


class _Trail:
    """The last centers of a target, in pixels of the current frame: they move with the scene."""

    def __init__(self, length: int) -> None:
        self._centers: deque[tuple[float, float]] = deque(maxlen=length)

    @property
    def points(self) -> Points:
        """(N, 2), the oldest first."""
        return np.array(self._centers, dtype=np.float64).reshape(-1, 2)

    def add(self, track: Track | None, motion: Motion | None) -> None:
        """Move the trail with the scene, and add the center of the target if it is not lost."""
        if motion is not None and self._centers:
            moved = map_points(motion.cur_from_prev, self.points).tolist()
            self._centers = deque([(x, y) for x, y in moved], maxlen=self._centers.maxlen)
        if track is not None and not track.lost:
            x, y, w, h = track.box
            self._centers.append((x + w / 2, y + h / 2))


def _mapped(track: Track, view: CameraView) -> Track:
    """The track in the pixels of the view."""
    return track.mapped(view.out_from_raw, view.size_wh)
