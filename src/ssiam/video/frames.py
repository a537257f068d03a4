"""`Frame` and `Source`: images in the order of time, from any kind of input."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeAlias

from numpy.typing import NDArray

from ssiam.copying import NotCopyable
from ssiam.errors import FrameSizeError, SourceError
from ssiam.geometry import Image, png_bytes
from ssiam.track import Track
from ssiam.video.drawing import draw_tracks

if TYPE_CHECKING:
    from ssiam.video.sound import Sound

TimedImage: TypeAlias = tuple[float | None, Image]
"""Seconds since the first frame, None if unknown, and the image, (H, W, 3) uint8 BGR."""

TimedImages: TypeAlias = Generator[TimedImage, None, None]

DecodedImage: TypeAlias = tuple[float | None, NDArray[Any]]
"""As `TimedImage`, but with the image as decoded: (H, W) or (H, W, 3), any bit depth."""

DecodedImages: TypeAlias = Generator[DecodedImage, None, None]


@dataclass(frozen=True, eq=False, repr=False)
class Frame:
    """One image of a source; notebooks show it.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    index : int
        Frame number, from 0, counted over the delivered frames.
    time : float or None
        Seconds since the first frame; None if the source has no timestamps.
    image : (H, W, 3) uint8
        BGR, upright: rotation and mirroring noted in the file's metadata are applied. Images of
        more than 8 bits are scaled to 8 bits with one pair of levels for the whole source.
    """

    index: int
    time: float | None
    image: Image

    def drawn(self, *tracks: Track) -> Frame:
        """The frame with the tracks drawn into a copy of its image, as by `draw_tracks`."""
        return replace(self, image=draw_tracks(self.image, tracks))

    def __repr__(self) -> str:
        (height, width), time = self.image.shape[:2], self.time
        return f"Frame({self.index}, {'' if time is None else f'{time:.3f} s, '}{width}x{height})"

    def _repr_png_(self) -> bytes:
        """The image, as notebooks show it."""
        return png_bytes(self.image)


@dataclass
class SourceInfo:
    """Metadata of a source; the counts grow while it is read.

    Attributes
    ----------
    is_variable : bool
        Frame times are not multiples of ``1 / fps``: variable frame rate, or times of arrival.
    is_rate_known : bool
        False if the source gives no frame rate, so that `Source.fps` is an assumption.
    pixel_aspect : Fraction
        Width of a pixel divided by its height, for display.
    sound : Sound or None
        The audio streams, if there are any and the source was opened with sound.
    undecoded : int
        Number of frames so far that could not be decoded and were skipped.
    notes : list of str
        Assumptions made while reading, one line each, to show to the user.
    origin : Fraction or None
        Time of the first frame by the clock of the container, seconds; None until it is known, or
        without timestamps.
    levels : (low, high) or None
        The levels that were estimated, for more than 8 bits per value.
    """

    is_variable: bool = False
    is_rate_known: bool = True
    pixel_aspect: Fraction = Fraction(1)
    sound: Sound | None = None
    undecoded: int = 0
    notes: list[str] = field(default_factory=list)
    origin: Fraction | None = None
    levels: tuple[float, float] | None = None


class Source(NotCopyable):
    """Iterator of `Frame`; a context manager that releases the file, camera or connection.

    Threads: one thread at a time.

    A source is read once, from front to back, and holds only a few frames at a time. Made by
    `open_source`; opening decodes the first frame, so that unreadable input fails there.

    Attributes
    ----------
    name : str
        Name of the source in messages; never contains a password.
    fps : Fraction
        Frames per second, exact (30000/1001 is kept). For a variable frame rate the announced
        rate, usually the average; `Frame.time` has the actual times.
    length : int or None
        Announced number of frames, for progress bars; None if the source gives none.
    size_wh : (int, int)
        Width and height of every frame, pixels.
    info : SourceInfo
        Further metadata, and the number of frames skipped so far.

    Raises
    ------
    StreamError
        While iterating: the source broke off. All frames before were delivered.
    FrameSizeError
        While iterating: a frame differs in size from those before it.
    """

    def __init__(
        self,
        name: str,
        images: TimedImages,
        *,
        fps: Fraction,
        length: int | None,
        info: SourceInfo | None = None,
    ) -> None:
        first = next(images, None)
        if first is None:
            raise SourceError(f"{name}: no frame in it can be decoded; is it damaged or truncated?")
        self.name = name
        self.fps = fps
        self.length = length
        self.info = info or SourceInfo()
        self.size_wh = _size_wh(first[1])
        self._images = images
        self._frames = self._numbered(first)

    def __repr__(self) -> str:
        width, height = self.size_wh
        length = "" if self.length is None else f", {self.length} frames"
        return f"Source({self.name!r}, {width}x{height}, {float(self.fps):.2f} fps{length})"

    def __iter__(self) -> Iterator[Frame]:
        return self

    def __next__(self) -> Frame:
        return next(self._frames)

    def __enter__(self) -> Source:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the input and end the iteration. May be called twice."""
        self._frames.close()
        self._images.close()

    def _numbered(self, first: TimedImage) -> Generator[Frame, None, None]:
        yield Frame(0, *first)
        # Otherwise the first image would stay in memory as long as the source.
        del first
        for index, (time, image) in enumerate(self._images, start=1):
            if _size_wh(image) != self.size_wh:
                raise FrameSizeError(_size_message(self.name, index, self.size_wh, image))
            yield Frame(index, time, image)


def _size_wh(image: Image) -> tuple[int, int]:
    height, width = image.shape[:2]
    return width, height


def _size_message(name: str, index: int, size_wh: tuple[int, int], image: Image) -> str:
    width, height = _size_wh(image)
    return (
        f"{name}: frame {index} (from 0) is {width}x{height} pixels, the frames before it "
        f"{size_wh[0]}x{size_wh[1]}; split the source there or scale it to one size"
    )


def with_following(frames: Iterable[Frame]) -> Iterator[tuple[Frame, Frame | None]]:
    """Pair each frame with the next one; the last frame is paired with None.

    If reading the next frame fails, the current frame is yielded with None before the error is
    raised. Frames are delayed by one, so this is meant for files, not for cameras.
    """
    upcoming = iter(frames)
    current = next(upcoming, None)
    while current is not None:
        try:
            following = next(upcoming, None)
        except Exception:
            yield current, None
            raise
        yield current, following
        current = following
