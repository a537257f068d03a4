"""Outputs of `ssiam track`: their paths (`OutputPaths`), and all sinks as one (`Outputs`)."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType

from ssiam.errors import SinkError
from ssiam.geometry import IDENTITY, Image
from ssiam.outputs import NamedPath, check_output, leftover_parts, numbered_names
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
from ssiam.video.plots import check_plot
from ssiam.video.results import result_paths
from ssiam.video.sinks import video_format
from ssiam.video.source_files import check_distinct_from_source


@dataclass(frozen=True)
class OutputPaths:
    """Paths of the outputs of `ssiam track`.

    Attributes
    ----------
    video, results, plot : Path or None
        None omits the output.
    layout : str or None
        Layout of the results.
    targets : int
        Number of targets.
    overwrite : bool
        Whether existing files may be replaced.
    leftover_parts : tuple of Path
        Partial files of these outputs from earlier runs.
    """

    video: Path | None
    results: Path | None
    plot: Path | None
    layout: str | None
    targets: int
    overwrite: bool
    leftover_parts: tuple[Path, ...] = ()

    @classmethod
    def default(cls, stem: str, targets: int, overwrite: bool) -> OutputPaths:
        """``STEM-tracked.mp4`` and ``.csv`` in the current folder, numbered to be unused."""
        leftovers: list[Path] = []
        for name in numbered_names(f"{stem}-tracked"):
            video, results = Path(f"{name}.mp4"), Path(f"{name}.csv")
            parts = [part for path in (video, results) for part in leftover_parts(path)]
            leftovers += parts
            if overwrite or not (parts or video.exists() or results.exists()):
                return cls(video, results, None, None, targets, overwrite, tuple(leftovers))
        raise AssertionError("unreachable: the loop is infinite")

    @classmethod
    def explicit(
        cls,
        video: Path | None,
        results: Path | None,
        plot: Path | None,
        layout: str | None,
        targets: int,
        overwrite: bool,
    ) -> OutputPaths:
        """The paths given by the user; `SinkError` for an unknown kind of results."""
        chosen = cls(video, results, plot, layout, targets, overwrite)
        leftovers = [part for _, path in chosen.files() for part in leftover_parts(path)]
        return replace(chosen, leftover_parts=tuple(leftovers))

    def files(self) -> list[NamedPath]:
        """All files to be written, with their options."""
        results = self.results and result_paths(
            self.results, layout=self.layout, targets=self.targets
        )
        options = (("--out", self.video), ("--plot", self.plot))
        found = [(option, path) for option, path in options if path is not None]
        return [*found, *(("--results", path) for path in results or ())]

    def check(self, source: str, weights: Sequence[NamedPath]) -> None:
        """Check the outputs before anything is opened.

        Raises
        ------
        ArgumentError
            An output is an input, or two outputs are one file.
        SinkError
            An output cannot be written, is of an unknown kind, or exists and must not be replaced.
        MissingExtraError
            A plot is requested, and matplotlib is not installed.
        """
        check_distinct_from_source(self.files(), source, weights)
        for _, path in self.files():
            check_output(path, overwrite=self.overwrite)
        if self.video is not None:
            video_format(self.video)
        if self.plot is not None:
            check_plot(self.plot)


class Outputs:
    """The video, the results and the plot of one run, each optional; a context manager.

    All of them are opened on construction, so that an unwritable one fails before any work is
    done. Each is renamed to its final name on exit, also after Ctrl-C. If writing one of them
    fails, all remain as part files.

    Raises
    ------
    MissingExtraError
        A plot is requested, and matplotlib is not installed.
    SinkError
        On construction, writing or exit: an output cannot be written.
    """

    def __init__(
        self,
        source: Source,
        paths: OutputPaths,
        *,
        side_by_side: bool,
        config: StabilizerConfig,
    ) -> None:
        self._border = config.border
        self._side_by_side = side_by_side
        self._main: int | None = None  # the target that began first, whose view is written
        self._video: VideoSink | None = None
        self._results: ResultSink | None = None
        self._plot: PathPlot | None = None
        overwrite = paths.overwrite
        with ExitStack() as stack:
            stack.callback(self._abandon)
            if paths.results is not None:
                self._results = open_results(
                    paths.results,
                    layout=paths.layout,
                    targets=paths.targets,
                    overwrite=overwrite,
                )
            if paths.plot is not None:
                self._plot = PathPlot(paths.plot, config.paper.window, overwrite=overwrite)
            if paths.video is not None:
                self._video = _video_sink(paths.video, source, overwrite=overwrite)
            stack.pop_all()

    def locations(self) -> list[tuple[str, Path]]:
        """Kind and current path of each output, which is a part file before the end."""
        video, plot = self._video and self._video.location, self._plot and self._plot.location
        found = [("video", video)] if video else []
        found += [("results", path) for path in (self._results.locations if self._results else ())]
        return found + ([("plot", plot)] if plot else [])

    @property
    def notes(self) -> list[str]:
        """Omitted sound and frames of the video, one line each; complete after the end."""
        if not self._video:
            return []
        no_sound, dropped = self._video.sound_omitted, self._video.dropped_frames
        lines = [f"video: has no sound: {no_sound}"] if no_sound else []
        if dropped:
            lines.append(
                f"video: {dropped} frames are omitted, because they come faster than the fixed "
                "rate of an AVI; write .mp4 or .mkv to keep them"
            )
        return lines

    def write(self, frame: Frame, tracks: Sequence[Track | None], fps: float | None = None) -> None:
        """Write one frame and the tracks of its targets; None for those that have not begun."""
        if self._main is None:
            begun = (number for number, track in enumerate(tracks) if track is not None)
            self._main = next(begun, None)
        main = None if self._main is None else tracks[self._main]
        if self._results:
            self._results.write(frame.index, frame.time, tracks)
        if self._plot and main is not None:
            self._plot.write(main)
        if self._video:
            self._video.write(self._annotated(frame.image, tracks, main, fps), frame.time)

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

    def _annotated(
        self,
        image: Image,
        tracks: Sequence[Track | None],
        main: Track | None,
        fps: float | None,
    ) -> Image:
        begun = {number: track for number, track in enumerate(tracks, 1) if track is not None}
        numbers = list(begun) if len(tracks) > 1 else None
        drawn = draw_tracks(image, list(begun.values()), fps=fps, numbers=numbers)
        if not self._side_by_side:
            return drawn
        stab_from_raw = None if main is None else main.stab_from_raw
        view = FrameView(drawn, IDENTITY if stab_from_raw is None else stab_from_raw, self._border)
        return side_by_side(drawn, view.render())


def _video_sink(path: Path, source: Source, *, overwrite: bool) -> VideoSink:
    info = source.info
    return VideoSink(
        path,
        source.fps,
        overwrite=overwrite,
        pixel_aspect=info.pixel_aspect,
        is_variable=info.is_variable,
        sound=info.sound,
    )
