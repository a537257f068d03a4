"""Sources of frames, sinks for results and videos, and drawing."""

from ssiam.video.drawing import COLORS, Overlay, draw_tracks, side_by_side
from ssiam.video.frames import Frame, Source, with_following
from ssiam.video.plots import PathPlot
from ssiam.video.results import ResultSink, open_results
from ssiam.video.sinks import VideoSink
from ssiam.video.sources import RawFormat, open_source

__all__ = [
    "COLORS",
    "Frame",
    "Overlay",
    "PathPlot",
    "RawFormat",
    "ResultSink",
    "Source",
    "VideoSink",
    "draw_tracks",
    "open_results",
    "open_source",
    "side_by_side",
    "with_following",
]
