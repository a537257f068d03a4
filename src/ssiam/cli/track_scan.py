"""`SourceScan`: what a run that reads its source several times has found in the first reading."""

from __future__ import annotations

from dataclasses import dataclass, field

from ssiam.cli.moments import Span
from ssiam.cli.track_run import SourceOptions
from ssiam.errors import StreamError
from ssiam.video.frames import SourceInfo
from ssiam.video.reversing import FrameRecord, ReversedFrames


@dataclass(kw_only=True)
class SourceScan:
    """The frames of the span, and how the source ended.

    Attributes
    ----------
    info : SourceInfo
    first : int
        Index of the first frame of the span.
    records : list of FrameRecord
        Of each frame of the span.
    fault : StreamError or None
        Why the source broke off.
    """

    info: SourceInfo
    first: int = 0
    records: list[FrameRecord] = field(default_factory=list)
    fault: StreamError | None = None

    @property
    def indexes(self) -> range:
        """The indexes of the frames of the span."""
        return range(self.first, self.first + len(self.records))

    def span(self) -> Span:
        """The frames of the span, by their numbers."""
        return Span.of_frames(self.indexes.start, self.indexes.stop - 1)

    def reversed_frames(self, source: SourceOptions) -> ReversedFrames:
        """The frames of the span from the last to the first."""
        return ReversedFrames(
            source.spec,
            self.records,
            self.first,
            self.info,
            raw=source.raw,
            stream=source.stream,
            levels=source.levels,
        )
