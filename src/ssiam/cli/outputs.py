"""What `ssiam track` writes: where it goes (`Destinations`), and all of it as one sink."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from types import TracebackType

from ssiam.errors import SinkError
from ssiam.geometry import IDENTITY, Image
from ssiam.outputs import NamedPath, check_output, leftover_parts
from ssiam.stabilize import FrameView, StabilizerConfig
from ssiam.track import Track
from ssiam.video import (
    Frame,
    PathPlot,
    ResultSink,
    Source,
    VideoSink,
    draw_tracks,
    open_results,
    side_by_side,
)
from ssiam.video.results import result_paths
from ssiam.video.source_files import check_apart_from_source


@dataclass(frozen=True)
class Destinations:
    """Where `ssiam track` writes; what is None is not written.

    Attributes
    ----------
    video, results, plot : Path or None
    layout : str or None
        Of the results.
    targets : int
    overwrite : bool
        Whether existing files may be replaced.
    left : tuple of Path
        Parts of these outputs that earlier runs left.
    """

    video: Path | None
    results: Path | None
    plot: Path | None
    layout: str | None
    targets: int
    overwrite: bool
    left: tuple[Path, ...] = ()

    @classmethod
    def by_default(cls, stem: str, targets: int, overwrite: bool) -> Destinations:
        """``STEM-tracked.mp4`` and ``.csv`` in the current folder, counted up to free names."""
        left: list[Path] = []
        for number in count(1):
            name = f"{stem}-tracked" if number == 1 else f"{stem}-tracked-{number}"
            video, results = Path(f"{name}.mp4"), Path(f"{name}.csv")
            parts = [part for path in (video, results) for part in leftover_parts(path)]
            left += parts
            if overwrite or not (parts or video.exists() or results.exists()):
                return cls(video, results, None, None, targets, overwrite, tuple(left))
        raise AssertionError("unreachable: the names do not end")

    @classmethod
    def given(
        cls,
        video: Path | None,
        results: Path | None,
        plot: Path | None,
        layout: str | None,
        targets: int,
        overwrite: bool,
    ) -> Destinations:
        """The files that the user named; `SinkError` for results of an unknown kind."""
        chosen = cls(video, results, plot, layout, targets, overwrite)
        left = [part for _, path in chosen.files() for part in leftover_parts(path)]
        return replace(chosen, left=tuple(left))

    def files(self) -> list[NamedPath]:
        """All files that will be written, with their options."""
        results = self.results and result_paths(
            self.results, layout=self.layout, targets=self.targets
        )
        options = (("--out", self.video), ("--plot", self.plot))
        found = [(option, path) for option, path in options if path is not None]
        return [*found, *(("--results", path) for path in results or ())]

    def check(self, source: str, weights: Sequence[NamedPath]) -> None:
        """Refuse outputs that are inputs or that cannot be written, before anything is opened.

        Raises
        ------
        ArgumentError
            An output is an input, or two outputs are one file.
        SinkError
            One exists and is not to be overwritten, or cannot be written.
        """
        check_apart_from_source(self.files(), source, weights)
        for _, path in self.files():
            check_output(path, overwrite=self.overwrite)


class Outputs:
    """The video, the results and the plot of one run; each may be left out.

    All of them are opened at once, so that one that cannot be written is known before any work
    is done. Each gets its name when it is whole, also after Ctrl-C; when one of them cannot be
    written any more, the others too stay in their parts.
    """

    def __init__(
        self,
        source: Source,
        destinations: Destinations,
        *,
        side_by_side: bool,
        config: StabilizerConfig,
    ) -> None:
        self._border = config.border
        self._side_by_side = side_by_side
        self._video: VideoSink | None = None
        self._results: ResultSink | None = None
        self._plot: PathPlot | None = None
        overwrite = destinations.overwrite
        with ExitStack() as stack:
            stack.callback(self._abandon)
            if destinations.results is not None:
                self._results = open_results(
                    destinations.results,
                    layout=destinations.layout,
                    targets=destinations.targets,
                    overwrite=overwrite,
                )
            if destinations.plot is not None:
                self._plot = PathPlot(destinations.plot, config.paper.window, overwrite=overwrite)
            if destinations.video is not None:
                self._video = _video_sink(destinations.video, source, overwrite=overwrite)
            stack.pop_all()

    def locations(self) -> list[tuple[str, Path]]:
        """What was written, and where it is now: under its name or in its part."""
        video, plot = self._video and self._video.location, self._plot and self._plot.location
        found = [("video", video)] if video else []
        found += [("results", path) for path in (self._results.locations if self._results else ())]
        return found + ([("plot", plot)] if plot else [])

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
        if isinstance(exc, SinkError):
            self._abandon()
            return
        stack = ExitStack()
        for sink in (self._results, self._plot, self._video):
            if sink is not None:
                stack.push(sink)
        stack.__exit__(exc_type, exc, traceback)

    def _abandon(self) -> None:
        for sink in (self._video, self._plot, self._results):
            if sink is not None:
                sink.abandon()

    def _picture(self, image: Image, tracks: Sequence[Track], fps: float | None) -> Image:
        drawn = draw_tracks(image, tracks, fps=fps)
        if not self._side_by_side:
            return drawn
        stab_from_raw = tracks[0].stab_from_raw
        view = FrameView(drawn, IDENTITY if stab_from_raw is None else stab_from_raw, self._border)
        return side_by_side(drawn, view.render())


def _video_sink(path: Path, source: Source, *, overwrite: bool) -> VideoSink:
    facts = source.facts
    return VideoSink(
        path,
        source.fps,
        overwrite=overwrite,
        pixel_aspect=facts.pixel_aspect,
        is_variable=facts.is_variable,
        sound=facts.sound,
    )
