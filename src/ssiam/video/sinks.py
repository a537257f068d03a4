"""`VideoSink`: writes frames to a video file."""

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
from ssiam.video.sound import Sound, SoundCopy

_log = logging.getLogger(__name__)

_FORMATS = {".mp4": "mp4", ".m4v": "mp4", ".mov": "mov", ".mkv": "matroska", ".avi": "avi"}
# A killed program loses only the few frames that the encoder holds: mp4 is written in fragments of
# one frame (2 % more bytes) and converted to a plain mp4 on closing, Matroska in short clusters.
_FLUSHED = {"flush_packets": "1"}
_FRAGMENTED = {"movflags": "hybrid_fragmented+frag_every_frame"}
_MUXER_OPTIONS = {
    "mp4": _FRAGMENTED,
    "mov": _FRAGMENTED,
    "matroska": {"cluster_time_limit": "40"},  # milliseconds
    "avi": {},
}
_KEY_FRAME_SECONDS = 1
# In order of preference; builds of FFmpeg without x264 have one of the others. No lookahead and
# no B-frames: 32 MB instead of 79 MB at 1280x720, and times that need no reordering.
_ENCODERS: dict[str, dict[str, str]] = {
    "libx264": {"preset": "superfast", "crf": "23", "rc-lookahead": "0", "bf": "0"},
    "libopenh264": {"allow_skip_frames": "0"},
    "mpeg4": {"qscale": "4"},
}
# One frame is encoded while the next is tracked.
_ENCODER_THREADS = 2
# Lowest frame rate of an AVI with variable frame times: it has one rate for all frames, and this
# keeps times to 5 ms.
_AVI_GRID = 100
# Seconds over which an AVI repeats a frame; a longer pause has no frames, as written by FFmpeg.
_AVI_LONGEST = 60
# FFmpeg's numbers for what cv2.COLOR_BGR2YUV_I420 makes: BT.601 in the range 16..235.
_COLOR_SPACE_601, _COLOR_RANGE_LIMITED = 6, 1
# Least number of ticks per second; variable frame times are kept to 0.1 ms.
_RESOLUTION = 10_000
# Denominators of real frame rates are 1 and 1001.
_LARGEST_DENOMINATOR = 1001
# A time more than this many frames before the last one starts a new count; a smaller step back is
# a rounding error or a reordered frame.
_JUMP_STEPS = 10


class VideoSink(NotCopyable, ClosedOnExit):
    """Writes frames as H.264 to .mp4, .m4v, .mov, .mkv or .avi; a context manager.

    Threads: one thread at a time.

    Frames go to ``NAME.part.EXT``, which `close` renames, also after Ctrl-C or an exception, with
    all frames that were written. If the program is killed or the disk is full, the part file
    remains and plays to its last frame, and an existing file NAME.EXT is kept.

    Parameters
    ----------
    path : str or Path
        The file; its folder must exist.
    fps : Fraction or float
        Frames per second, for frames that are written without a time; a Fraction is kept exactly.
    size_wh : (int, int) or None
        Width and height of the frames in pixels; None takes those of the first frame.
        Odd sizes are padded to even ones, as H.264 requires.
    pixel_aspect : Fraction
        Width of a pixel divided by its height, for players; the pixels are written unchanged.
    is_variable : bool
        The times given to `write` are not multiples of ``1 / fps``. An AVI, which has one rate
        for all frames and repeats them over gaps, then gets a rate that is high enough for them.
    sound : Sound or None
        Copied into the file up to the end of the last frame; requires frames with times.
    overwrite : bool
        Whether an existing file may be replaced.

    Attributes
    ----------
    dropped_frames : int
        Frames that were not written because an AVI's rate is too low for their times.
    sound_omitted : str or None
        Why sound is omitted; None if all of it is written.

    Raises
    ------
    SinkError
        On construction if `path` cannot be written, or exists and `overwrite` is False; later if
        the disk is full.
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
        self.dropped_frames = 0
        self.sound_omitted: str | None = None
        self._rate = _exact_rate(fps)
        self._pixel_aspect = pixel_aspect
        self._sound = sound
        self._copy: SoundCopy | None = None
        muxer = video_format(self.path)
        self._is_constant = muxer == "avi"
        step = max(1, math.ceil(_AVI_GRID / self._rate)) if is_variable else 1
        self._clock = _FrameClock(self._rate, whole_frames=self._is_constant, step=step)
        self._last: tuple[int, Image] | None = None
        self._part = PartFile(self.path, overwrite=overwrite)
        self._container = _create(self._part.file, muxer)
        self._stream: VideoStream | None = None
        self._is_empty = True
        self._failed = False

    @property
    def location(self) -> Path | None:
        """The file that has the video now: the output, its part file, or None without frames."""
        return self._part.location

    def write(self, image: Image, time: float | None = None) -> float | None:
        """Append a frame.

        Parameters
        ----------
        image : (H, W, 3) uint8 BGR
        time : float or None
            Seconds from any origin; keeps a variable frame rate. None places the frame
            ``1 / fps`` after the previous one.

        Returns
        -------
        float or None
            Time of the frame in the file, seconds; None if it was dropped.

        Raises
        ------
        FrameSizeError
            The frame differs in size from those before it.
        SinkError
            The disk is full.
        """
        height, width = image.shape[:2]
        if self.size_wh is None:
            self.size_wh = (width, height)
        if (width, height) != self.size_wh:
            raise FrameSizeError(
                f"{self.path}: a frame of {width}x{height} pixels cannot follow those of "
                f"{self.size_wh[0]}x{self.size_wh[1]}; write it to a separate file"
            )
        ticks = self._clock.next_ticks(time)
        if ticks is None:
            self.dropped_frames += 1
            return None
        yuv = _even_yuv420(image)
        written_time = float(ticks * self._clock.time_base)
        try:
            if self._stream is None:
                self._stream = self._begin(self._frame(yuv, ticks), has_time=time is not None)
            if self._is_constant:
                self._repeat_until(self._stream, ticks)
                self._last = ticks, yuv
            self._container.mux(self._stream.encode(self._frame(yuv, ticks)))
            self._is_empty = False
            if self._copy is not None and time is not None:
                self._copy.follow(time, written_time)
        except (av.FFmpegError, OSError) as error:
            self._failed = True
            raise self._part.error(error) from error
        return written_time

    def _frame(self, yuv: Image, ticks: int) -> VideoFrame:
        frame = VideoFrame.from_ndarray(yuv, format="yuv420p")
        frame.pts, frame.time_base = ticks, self._clock.time_base
        return frame

    def _repeat_until(self, stream: VideoStream, ticks: int) -> None:
        """Repeat the last frame up to `ticks`, for a container with one rate for all frames."""
        if self._last is None:
            return
        last, yuv = self._last
        if (ticks - last) * self._clock.time_base <= _AVI_LONGEST:
            for between in range(last + 1, ticks):
                self._container.mux(stream.encode(self._frame(yuv, between)))

    def _begin(self, frame: VideoFrame, *, has_time: bool) -> VideoStream:
        """Add the video stream and the sound that the container supports, and write the header."""
        stream = self._add_video(frame)
        if self._sound is None:
            return stream
        if not has_time or self._sound.origin is None:
            self.sound_omitted = "the source has no timestamps"
        else:
            self._copy = SoundCopy(self._container, self._sound)
            self.sound_omitted = self._copy.omitted(self.path.suffix)
            try:
                self._container.start_encoding()
            except av.FFmpegError:
                self.sound_omitted = self._copy.omitted(self.path.suffix, header_failed=True)
                self._copy = None
                stream = self._restart_without_sound(frame)
        if self._copy is None:
            self._sound.discard()
        return stream

    def _add_video(self, frame: VideoFrame) -> VideoStream:
        rate = 1 / self._clock.time_base if self._is_constant else self._rate
        return _add_stream(self._container, rate, self._clock.time_base, frame, self._pixel_aspect)

    def _restart_without_sound(self, frame: VideoFrame) -> VideoStream:
        """Start the file again after the container failed to write its header with sound."""
        with suppress(av.FFmpegError, OSError):
            self._container.close()
        self._container = _create(self._part.file, self._container.format.name)
        return self._add_video(frame)

    def close(self) -> None:
        """Finish the file and rename it to its final name. May be called twice."""
        self._finish(rename=True)

    def abandon(self) -> None:
        """Finish the part file without renaming it."""
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


def video_format(path: Path) -> str:
    """FFmpeg's name of the format of a video with this name; `SinkError` if it is unknown."""
    muxer = _FORMATS.get(path.suffix.lower())
    if muxer is None:
        known = " ".join(_FORMATS)
        raise SinkError(f"{path}: unknown kind of video; name it with one of {known}")
    return muxer


def _create(path: Path, muxer: str) -> OutputContainer:
    options = _FLUSHED | _MUXER_OPTIONS[muxer]
    # "file:" keeps FFmpeg from interpreting a colon or a percent sign in the name.
    container: OutputContainer = av.open(f"file:{path}", mode="w", format=muxer, options=options)
    return container


def _add_stream(
    container: OutputContainer,
    rate: Fraction,
    time_base: Fraction,
    frame: VideoFrame,
    pixel_aspect: Fraction,
) -> VideoStream:
    name = _encoder()
    options = _ENCODERS[name] | {"g": str(max(1, round(_KEY_FRAME_SECONDS * rate)))}
    stream = cast(VideoStream, container.add_stream(name, rate=rate, options=options))
    stream.width, stream.height, stream.pix_fmt = frame.width, frame.height, "yuv420p"
    stream.thread_count, stream.thread_type = _ENCODER_THREADS, ThreadType.FRAME
    context = stream.codec_context
    context.time_base = time_base
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
    """The frame in planar YUV, with the last row and column repeated if their number is odd."""
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        image = np.asarray(
            cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE),
            dtype=np.uint8,
        )
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420), dtype=np.uint8)


def _exact_rate(fps: Fraction | float) -> Fraction:
    """The exact frame rate: 29.97002997 becomes 30000/1001; `ValueError` if not positive."""
    if not 0 < fps < float("inf"):
        raise ValueError(f"frame rate {fps} is not a positive number of frames per second")
    return (
        fps if isinstance(fps, Fraction) else Fraction(fps).limit_denominator(_LARGEST_DENOMINATOR)
    )


class _FrameClock:
    """Converts frame times to strictly increasing ticks from 0, of `time_base` seconds each.

    Parameters
    ----------
    rate : Fraction
        Frames per second; a frame without a time comes one step of ``1 / rate`` after the last.
    whole_frames : bool
        Ticks are frames of the container, for containers with one rate for all frames. A frame
        that would be delayed by more than one of them is dropped.
    step : int
        Number of container frames per step, with `whole_frames`.
    """

    def __init__(self, rate: Fraction, *, whole_frames: bool = False, step: int = 1) -> None:
        self._may_drop = whole_frames
        finer = -(-_RESOLUTION // rate.numerator)
        self.time_base = 1 / (rate * step) if whole_frames else Fraction(1, rate.numerator * finer)
        self._step = step if whole_frames else rate.denominator * finer
        self._last: int | None = None
        self._origin: int | None = None

    @property
    def end(self) -> int:
        """Ticks at which the last frame ends, if it lasts one step."""
        return 0 if self._last is None else self._last + self._step

    def next_ticks(self, time: float | None = None) -> int | None:
        """Ticks of the next frame; None if it must be dropped.

        `time` is in seconds from any origin; None means one step after the last frame. If times
        jump back, as in joined recordings, counting continues with one step. Times that are too
        close together are moved by single ticks.
        """
        if time is None:
            self._last = self.end
            return self._last
        ticks = round(time / self.time_base)
        last = -1 if self._last is None else self._last
        if self._origin is None:
            self._origin = ticks - self.end
        elif self._is_crowded(time / self.time_base - self._origin):
            return None
        elif ticks - self._origin < last - _JUMP_STEPS * self._step:
            self._origin = ticks - self.end
        self._last = max(ticks - self._origin, last + 1)
        return self._last

    def _is_crowded(self, due: float) -> bool:
        """Whether the last frame is still displayed at the ticks at which the next one is due."""
        if not self._may_drop or self._last is None:
            return False
        return self._last - _JUMP_STEPS * self._step <= due < self._last
