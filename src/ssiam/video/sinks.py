"""`VideoSink`: frames into a video file."""

from __future__ import annotations

import logging
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import cast

import av
import cv2
import numpy as np
from av.codec.context import ThreadType
from av.container import OutputContainer
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ssiam.copying import NotCopied
from ssiam.errors import FrameSizeError, SinkError
from ssiam.geometry import Image
from ssiam.video.clock import Clock, as_rate
from ssiam.video.outputs import check_output, output_error

_log = logging.getLogger(__name__)

_FORMATS = {".mp4": "mp4", ".m4v": "mp4", ".mov": "mov", ".mkv": "matroska", ".avi": "avi"}
# A program that is killed loses one piece of this length: mp4 is written in pieces that play as
# they are, and turned into a plain one on closing; Matroska in clusters (milliseconds).
_PIECE_SECONDS = 1
_FLUSHED = {"flush_packets": "1"}
_PIECEWISE = {"movflags": "hybrid_fragmented+frag_keyframe"}
_MUXER_OPTIONS = {
    "mp4": _PIECEWISE,
    "mov": _PIECEWISE,
    "matroska": {"cluster_time_limit": str(1000 * _PIECE_SECONDS)},
    "avi": {},
}
# In the order of preference; builds of FFmpeg without x264 have one of the others. No lookahead
# and no B-frames: 32 MB instead of 79 MB at 1280x720, and times that need no reordering.
_ENCODERS: dict[str, dict[str, str]] = {
    "libx264": {"preset": "superfast", "crf": "23", "rc-lookahead": "0", "bf": "0"},
    "libopenh264": {"allow_skip_frames": "0"},
    "mpeg4": {"qscale": "4"},
}
# One frame is encoded while the next is tracked.
_ENCODER_THREADS = 2
# FFmpeg's numbers for what cv2.COLOR_BGR2YUV_I420 makes: BT.601 in the range 16..235.
_COLOR_SPACE_601, _COLOR_RANGE_LIMITED = 6, 1


class VideoSink(NotCopied):
    """Writes frames as H.264 to .mp4, .m4v, .mov, .mkv or .avi; a context manager.

    Threads: one thread at a time.

    The file is complete after `close`; after Ctrl-C or an exception it holds all frames that were
    written, and an mp4 plays up to the last second even if the program is killed.

    Parameters
    ----------
    path : str or Path
        The file; replaced if it exists. Its folder must exist.
    fps : Fraction or float
        Frames a second, for frames that are written without a time; kept exactly as a Fraction.
    size_wh : (int, int) or None
        Width and height of the frames in pixels; None takes those of the first frame.
        Odd sizes are padded to even ones, as H.264 needs them.

    Raises
    ------
    SinkError
        On construction if `path` cannot be written; later if the disk is full.
    """

    def __init__(
        self,
        path: str | Path,
        fps: Fraction | float,
        size_wh: tuple[int, int] | None = None,
    ) -> None:
        self.path = Path(path)
        self.size_wh = size_wh
        self._rate = as_rate(fps)
        muxer = _FORMATS.get(self.path.suffix.lower())
        if muxer is None:
            known = " ".join(_FORMATS)
            raise SinkError(f"{self.path}: unknown kind of video; name it with one of {known}")
        check_output(self.path)
        self._clock = Clock(self._rate, only_whole_frames=muxer == "avi")
        self._container = _create(self.path, muxer)
        self._stream: VideoStream | None = None
        self._failed = False

    def write(self, image: Image, time: float | None = None) -> None:
        """Append a (H, W, 3) uint8 BGR frame.

        `time` is in seconds from any origin, which keeps a variable frame rate; without it the
        frame follows the one before by ``1 / fps``.
        """
        height, width = image.shape[:2]
        if self.size_wh is None:
            self.size_wh = (width, height)
        if (width, height) != self.size_wh:
            raise FrameSizeError(
                f"{self.path}: a frame of {width}x{height} pixels cannot follow those of "
                f"{self.size_wh[0]}x{self.size_wh[1]}; write it to a file of its own"
            )
        frame = VideoFrame.from_ndarray(_even_yuv420(image), format="yuv420p")
        frame.pts, frame.time_base = self._clock.ticks(time), self._clock.time_base
        try:
            if self._stream is None:
                self._stream = _add_stream(self._container, self._rate, self._clock, frame)
            self._container.mux(self._stream.encode(frame))
        except (av.FFmpegError, OSError) as error:
            self._failed = True
            raise output_error(self.path, error) from error

    def close(self) -> None:
        """Finish the file. May be called twice."""
        stream, self._stream = self._stream, None
        try:
            if stream is not None and not self._failed:
                self._container.mux(stream.encode(None))
            self._container.close()
        except (av.FFmpegError, OSError) as error:
            if not self._failed:
                self._failed = True
                raise output_error(self.path, error) from error

    def __enter__(self) -> VideoSink:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if exc_type is None:
            self.close()
            return
        # The exception on its way says more than what goes wrong because of it.
        with suppress(SinkError):
            self.close()


def _create(path: Path, muxer: str) -> OutputContainer:
    options = _FLUSHED | _MUXER_OPTIONS[muxer]
    # "file:" keeps a colon or a percent sign in the name from meaning something to FFmpeg.
    container: OutputContainer = av.open(f"file:{path}", mode="w", format=muxer, options=options)
    return container


def _add_stream(
    container: OutputContainer, rate: Fraction, clock: Clock, frame: VideoFrame
) -> VideoStream:
    name = _encoder()
    options = _ENCODERS[name] | {"g": str(max(1, round(_PIECE_SECONDS * rate)))}
    stream = cast(VideoStream, container.add_stream(name, rate=rate, options=options))
    stream.width, stream.height, stream.pix_fmt = frame.width, frame.height, "yuv420p"
    stream.thread_count, stream.thread_type = _ENCODER_THREADS, ThreadType.FRAME
    context = stream.codec_context
    context.time_base = clock.time_base
    context.colorspace, context.color_range = _COLOR_SPACE_601, _COLOR_RANGE_LIMITED
    _log.debug("writing %s with %s", container.name, name)
    return stream


def _encoder() -> str:
    for name in _ENCODERS:
        with suppress(av.codec.codec.UnknownCodecError):
            av.codec.Codec(name, "w")
            return name
    raise SinkError(f"this build of FFmpeg has none of {', '.join(_ENCODERS)}; reinstall av")


def _even_yuv420(image: Image) -> Image:
    """The frame in planar YUV, its last row and column doubled where their number is odd."""
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        image = np.asarray(
            cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE),
            dtype=np.uint8,
        )
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420), dtype=np.uint8)
