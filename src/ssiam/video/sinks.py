"""`VideoSink`: frames into a video file."""

from __future__ import annotations

import logging
import math
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import cv2
import numpy as np
from av.codec.context import ThreadType
from av.container import OutputContainer
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ssiam.copying import NotCopyable
from ssiam.errors import FrameSizeError, SinkError
from ssiam.geometry import Image
from ssiam.outputs import ClosedOnExit, PartFile
from ssiam.video.clock import Clock, as_rate
from ssiam.video.sound import Sound, SoundCopy

_log = logging.getLogger(__name__)

_FORMATS = {".mp4": "mp4", ".m4v": "mp4", ".mov": "mov", ".mkv": "matroska", ".avi": "avi"}
# A program that is killed loses the few frames that the encoder holds: mp4 is written in fragments
# of one frame (2 % more bytes) and turned into a plain one on closing, Matroska in short clusters.
_FLUSHED = {"flush_packets": "1"}
_FRAGMENTED = {"movflags": "hybrid_fragmented+frag_every_frame"}
_MUXER_OPTIONS = {
    "mp4": _FRAGMENTED,
    "mov": _FRAGMENTED,
    "matroska": {"cluster_time_limit": "40"},  # milliseconds
    "avi": {},
}
_KEY_FRAME_SECONDS = 1
# In the order of preference; builds of FFmpeg without x264 have one of the others. No lookahead
# and no B-frames: 32 MB instead of 79 MB at 1280x720, and times that need no reordering.
_ENCODERS: dict[str, dict[str, str]] = {
    "libx264": {"preset": "superfast", "crf": "23", "rc-lookahead": "0", "bf": "0"},
    "libopenh264": {"allow_skip_frames": "0"},
    "mpeg4": {"qscale": "4"},
}
# One frame is encoded while the next is tracked.
_ENCODER_THREADS = 2
# Frames a second, at least, of an AVI whose frames come at times of their own: it has one rate
# for all, so that times are kept to 5 ms.
_AVI_GRID = 100
# Seconds over which an AVI repeats a frame; a longer pause holds no frames, as FFmpeg writes it.
_AVI_LONGEST = 60
# FFmpeg's numbers for what cv2.COLOR_BGR2YUV_I420 makes: BT.601 in the range 16..235.
_COLOR_SPACE_601, _COLOR_RANGE_LIMITED = 6, 1


class VideoSink(NotCopyable, ClosedOnExit):
    """Writes frames as H.264 to .mp4, .m4v, .mov, .mkv or .avi; a context manager.

    Threads: one thread at a time.

    Frames go to ``NAME.part.EXT``, which `close` renames: also after Ctrl-C or an exception, with
    all frames that were written. If the program is killed or the disk is full the part stays, and
    plays to its last frames; what had the name before is kept.

    Parameters
    ----------
    path : str or Path
        The file; its folder must exist.
    fps : Fraction or float
        Frames a second, for frames that are written without a time; kept exactly as a Fraction.
    size_wh : (int, int) or None
        Width and height of the frames in pixels; None takes those of the first frame.
        Odd sizes are padded to even ones, as H.264 needs them.
    pixel_aspect : Fraction
        Width of a pixel by its height, for players; the pixels are written as they are.
    is_variable : bool
        The times given to `write` are no multiples of ``1 / fps``. An AVI, which has one rate
        for all frames and repeats them over gaps, then gets one that is high enough for them.
    sound : Sound or None
        Copied into the file up to the end of the last frame; frames need times for it.
    overwrite : bool
        Whether a file of that name may be replaced.

    Attributes
    ----------
    left_out : int
        Frames that were not written, because an AVI's rate is too low for their times.
    silence : str or None
        Why sound is left out; None if all of it is there.

    Raises
    ------
    SinkError
        On construction if `path` cannot be written, or exists and is not to be replaced; later
        if the disk is full.
    """

    def __init__(
        self,
        path: str | Path,
        fps: Fraction | float,
        size_wh: tuple[int, int] | None = None,
        *,
        pixel_aspect: Fraction = Fraction(1),
        is_variable: bool = False,
        sound: Sound | None = None,
        overwrite: bool = True,
    ) -> None:
        self.path = Path(path)
        self.size_wh = size_wh
        self.left_out = 0
        self.silence: str | None = None
        self._rate = as_rate(fps)
        self._pixel_aspect = pixel_aspect
        self._sound = sound
        self._copy: SoundCopy | None = None
        muxer = _FORMATS.get(self.path.suffix.lower())
        if muxer is None:
            known = " ".join(_FORMATS)
            raise SinkError(f"{self.path}: unknown kind of video; name it with one of {known}")
        self._is_constant = muxer == "avi"
        parts = max(1, math.ceil(_AVI_GRID / self._rate)) if is_variable else 1
        self._clock = Clock(self._rate, only_whole_frames=self._is_constant, parts=parts)
        self._last: tuple[int, Image] | None = None
        self._part = PartFile(self.path, overwrite=overwrite)
        self._container = _create(self._part.file, muxer)
        self._stream: VideoStream | None = None
        self._is_empty = True
        self._failed = False

    @property
    def location(self) -> Path | None:
        """Where the video is now: under its name, in its part, or None if no frame was written."""
        return self._part.location

    def write(self, image: Image, time: float | None = None) -> float | None:
        """Append a (H, W, 3) uint8 BGR frame; its time in the file, seconds, None if left out.

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
        ticks = self._clock.place(time)
        if ticks is None:
            self.left_out += 1
            return None
        yuv = _even_yuv420(image)
        shown = float(ticks * self._clock.time_base)
        try:
            if self._stream is None:
                self._stream = self._begin(self._frame(yuv, ticks), has_time=time is not None)
            if self._is_constant:
                self._repeat_until(self._stream, ticks)
                self._last = ticks, yuv
            self._container.mux(self._stream.encode(self._frame(yuv, ticks)))
            self._is_empty = False
            if self._copy is not None and time is not None:
                self._copy.follow(time, shown)
        except (av.FFmpegError, OSError) as error:
            self._failed = True
            raise self._part.error(error) from error
        return shown

    def _frame(self, yuv: Image, ticks: int) -> VideoFrame:
        frame = VideoFrame.from_ndarray(yuv, format="yuv420p")
        frame.pts, frame.time_base = ticks, self._clock.time_base
        return frame

    def _repeat_until(self, stream: VideoStream, ticks: int) -> None:
        """Fill the gap after the last frame with it, where the container has one rate."""
        if self._last is None:
            return
        last, yuv = self._last
        if (ticks - last) * self._clock.time_base <= _AVI_LONGEST:
            for between in range(last + 1, ticks):
                self._container.mux(stream.encode(self._frame(yuv, between)))

    def _begin(self, frame: VideoFrame, *, has_time: bool) -> VideoStream:
        """Add the streams, sound as far as the container takes it, and write the header."""
        stream = self._add_video(frame)
        if self._sound is None:
            return stream
        if not has_time or self._sound.origin is None:
            self.silence = "the source tells no times to go by"
        else:
            self._copy = SoundCopy(self._container, self._sound)
            self.silence = self._copy.silence(self.path.suffix)
            try:
                self._container.start_encoding()
            except av.FFmpegError:
                self.silence = self._copy.silence(self.path.suffix, begun=False)
                self._copy = None
                stream = self._begin_anew(frame)
        if self._copy is None:
            self._sound.drop()
        return stream

    def _add_video(self, frame: VideoFrame) -> VideoStream:
        rate = 1 / self._clock.time_base if self._is_constant else self._rate
        return _add_stream(self._container, rate, self._clock, frame, self._pixel_aspect)

    def _begin_anew(self, frame: VideoFrame) -> VideoStream:
        """The file without sound, where the container refused that with its header."""
        with suppress(av.FFmpegError, OSError):
            self._container.close()
        self._container = _create(self._part.file, self._container.format.name)
        return self._add_video(frame)

    def close(self) -> None:
        """Finish the file and give it its name. May be called twice."""
        self._finish(rename=True)

    def abandon(self) -> None:
        """Finish the file, and leave it under the name of its part."""
        with suppress(SinkError):
            self._finish(rename=False)

    def _finish(self, *, rename: bool) -> None:
        stream, self._stream = self._stream, None
        try:
            if stream is not None and not self._failed:
                self._repeat_until(stream, self._clock.end)
                self._container.mux(stream.encode(None))
                if self._copy is not None:
                    self._copy.write_until(float(self._clock.end * self._clock.time_base))
            self._container.close()
            if self._is_empty:
                self._part.discard()
            elif rename and not self._failed:
                self._part.finish()
        except (av.FFmpegError, OSError) as error:
            if not self._failed:
                self._failed = True
                raise self._part.error(error) from error


def _create(path: Path, muxer: str) -> OutputContainer:
    options = _FLUSHED | _MUXER_OPTIONS[muxer]
    # "file:" keeps a colon or a percent sign in the name from meaning something to FFmpeg.
    container: OutputContainer = av.open(f"file:{path}", mode="w", format=muxer, options=options)
    return container


def _add_stream(
    container: OutputContainer,
    rate: Fraction,
    clock: Clock,
    frame: VideoFrame,
    pixel_aspect: Fraction,
) -> VideoStream:
    name = _encoder()
    options = _ENCODERS[name] | {"g": str(max(1, round(_KEY_FRAME_SECONDS * rate)))}
    stream = cast(VideoStream, container.add_stream(name, rate=rate, options=options))
    stream.width, stream.height, stream.pix_fmt = frame.width, frame.height, "yuv420p"
    stream.thread_count, stream.thread_type = _ENCODER_THREADS, ThreadType.FRAME
    context = stream.codec_context
    context.time_base = clock.time_base
    context.sample_aspect_ratio = pixel_aspect
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
