"""`Outputs`: everything `ssiam track` writes, as one sink."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from ssiam.geometry import IDENTITY, Image
from ssiam.stabilize import FrameView, StabilizerConfig
from ssiam.trackers import Track
from ssiam.video import (
    Frame,
    PathPlot,
    Source,
    VideoSink,
    draw_tracks,
    open_results,
    side_by_side,
)


class Outputs:
    """The video, the results and the plot of one run; each may be left out.

    All of them are opened at once, so that one that cannot be written is known before any work
    is done.
    """

    def __init__(
        self,
        source: Source,
        *,
        video: Path | None,
        results: Path | None,
        layout: str | None,
        plot: Path | None,
        side_by_side: bool,
        config: StabilizerConfig,
        targets: int,
    ) -> None:
        self.written = {"video": video, "results": results, "plot": plot}
        self._border = config.border
        self._side_by_side = side_by_side
        with ExitStack() as stack:
            self._results = results and stack.enter_context(
                open_results(results, layout=layout, targets=targets)
            )
            self._plot = plot and stack.enter_context(PathPlot(plot, config.window))
            self._video = video and stack.enter_context(_video_sink(video, source))
            self._stack = stack.pop_all()

    @property
    def remarks(self) -> list[str]:
        """What is not in the video, a line each; complete after the outputs are closed."""
        if not self._video:
            return []
        silence, left_out = self._video.silence, self._video.left_out
        lines = [f"video: has no sound: {silence}"] if silence else []
        if left_out:
            lines.append(
                f"video: {left_out} frames are left out, which come faster than the one rate of "
                "an AVI; write .mp4 or .mkv to have all"
            )
        return lines

    def write(self, frame: Frame, tracks: Sequence[Track], fps: float | None = None) -> None:
        """Write one frame and its targets."""
        if self._results:
            self._results.write(frame.index, frame.time, tracks)
        if self._plot:
            self._plot.write(tracks[0])
        if self._video:
            self._video.write(self._picture(frame.image, tracks, fps), frame.time)

    def __enter__(self) -> Outputs:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.__exit__(exc_type, exc, traceback)

    def _picture(self, image: Image, tracks: Sequence[Track], fps: float | None) -> Image:
        drawn = draw_tracks(image, tracks, fps=fps)
        if not self._side_by_side:
            return drawn
        stab_from_raw = tracks[0].stab_from_raw
        view = FrameView(drawn, IDENTITY if stab_from_raw is None else stab_from_raw, self._border)
        return side_by_side(drawn, view.render())


def _video_sink(path: Path, source: Source) -> VideoSink:
    facts = source.facts
    return VideoSink(
        path,
        source.fps,
        pixel_aspect=facts.pixel_aspect,
        is_variable=facts.is_variable,
        sound=facts.sound,
    )
