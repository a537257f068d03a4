"""The frame rate of a container, as far as it can be believed, and who tells the times."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from itertools import pairwise
from statistics import median

from av.container import InputContainer
from av.video.stream import VideoStream

DEFAULT_FPS = Fraction(25)
# Nominal and average rate further apart than this share mean a variable frame rate.
_TOLERANCE = 0.05
# FFmpeg's AVFMT_NOTIMESTAMPS, of demuxers whose format has no times.
_NO_TIMESTAMPS = 0x0080
# Ends of the names of FFmpeg's demuxers of images, which take 25 of them a second.
_IMAGES = ("_pipe", "image2", "image2pipe")
# Frames a second. FFmpeg gives the ticks of the clock, 1000 and more, as the nominal rate of
# streams whose times it cannot make out; cameras that are faster tell an average as well.
_HIGHEST_NOMINAL = 480


class Times(Enum):
    """Where the times of frames come from."""

    STREAM = "the stream"
    ARRIVAL = "the clock of this machine"
    UNKNOWN = "nowhere"


@dataclass(frozen=True)
class Rate:
    """Frames a second; `fps` is None where it can only be measured."""

    fps: Fraction | None
    is_variable: bool = False


def origin_of_times(container: InputContainer, *, is_remote: bool) -> Times:
    """Whether the stream tells the times of its frames.

    Parts of a multipart stream (MJPEG over HTTP), images one after another and bare H.264 have
    none; FFmpeg counts them at 25 a second. Of a camera they are those of arrival. What comes
    faster than it was filmed, as a file does, has no times.
    """
    name = container.format.name
    is_bare = bool(container.format.flags & _NO_TIMESTAMPS) and name != "rawvideo"
    if not is_bare and not name.endswith(_IMAGES):
        return Times.STREAM
    is_endless = container.size <= 0
    return Times.ARRIVAL if is_endless and (is_remote or name == "mpjpeg") else Times.UNKNOWN


def frame_rate(stream: VideoStream, *, is_recording: bool) -> Rate:
    """The nominal rate, or the average one of a recording whose frames come at another pace.

    Nominal is the lowest rate that holds all frames: an average above it, as FFmpeg tells of DV,
    is none.
    """
    nominal, average = stream.guessed_rate, stream.average_rate
    if nominal and average and abs(nominal / average - 1) <= _TOLERANCE:
        return Rate(nominal, is_variable=not _fits(stream.base_rate, nominal))
    if is_recording and nominal and average and average < nominal:
        return Rate(average, is_variable=True)
    believable = [rate for rate in (nominal, average) if rate and rate <= _HIGHEST_NOMINAL]
    return Rate(believable[0]) if believable else Rate(None, is_variable=True)


def _fits(base: Fraction | None, nominal: Fraction) -> bool:
    """Whether the grid on which all times lie is that of the frames, or of their fields."""
    return not base or any(abs(base / (n * nominal) - 1) <= _TOLERANCE for n in (1, 2))


def measured_rate(times: list[float | None]) -> Fraction | None:
    """Frames a second by the times (seconds) of the first frames; None if they tell nothing."""
    known = [time for time in times if time is not None]
    gaps = [after - before for before, after in pairwise(known)]
    gap = median(gaps) if gaps else 0.0
    return Fraction(1 / gap).limit_denominator(1001) if gap > 0 else None
