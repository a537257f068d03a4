"""Where frames come from and where results go: sources, sinks, drawing."""

from ssiam.video.drawing import COLORS, draw_tracks
from ssiam.video.frames import Frame, Source
from ssiam.video.lookahead import with_following
from ssiam.video.panels import side_by_side
from ssiam.video.plots import PathPlot
from ssiam.video.results import ResultSink, open_results
from ssiam.video.sinks import VideoSink
from ssiam.video.sources import RawFormat, open_source

__all__ = [
    "COLORS",
    "Frame",
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
