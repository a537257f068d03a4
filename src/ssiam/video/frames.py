"""`Frame` and `Source`: pictures in the order of time, whatever they come from."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeAlias

from numpy.typing import NDArray

from ssiam.copying import NotCopyable
from ssiam.errors import FrameSizeError, SourceError
from ssiam.geometry import Image

if TYPE_CHECKING:
    from ssiam.video.sound import Sound

Picture: TypeAlias = tuple[float | None, Image]
Pictures: TypeAlias = Generator[Picture, None, None]
# As decoded: (H, W) or (H, W, 3), of any depth.
DeepPicture: TypeAlias = tuple[float | None, NDArray[Any]]
DeepPictures: TypeAlias = Generator[DeepPicture, None, None]


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a source.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    index : int
        Number of the frame, from 0, counted over the frames that were delivered.
    time : float or None
        Seconds since the first frame; None where the source tells no times.
    image : (H, W, 3) uint8
        BGR, upright: the turn and the mirroring that phones note in their files are applied.
        More than 8 bits are stretched to 8 by one rule for the whole source.
    """

    index: int
    time: float | None
    image: Image


@dataclass
class SourceFacts:
    """What a source says about itself beside its frames; the counts grow while it is read.

    Attributes
    ----------
    is_variable : bool
        The times of the frames are no multiples of ``1 / fps``: variable rate, or arrival.
    is_rate_known : bool
        False where the source tells no frame rate and `Source.fps` is an assumption.
    pixel_aspect : Fraction
        Width of a pixel by its height, as it is to be displayed.
    sound : Sound or None
        Its sound, where it has any and was opened with it.
    undecoded : int
        Frames so far that could not be decoded and were left out.
    remarks : list of str
        One line each for the user: what was assumed.
    """

    is_variable: bool = False
    is_rate_known: bool = True
    pixel_aspect: Fraction = Fraction(1)
    sound: Sound | None = None
    undecoded: int = 0
    remarks: list[str] = field(default_factory=list)


class Source(NotCopyable):
    """Iterator of `Frame`; a context manager that lets go of the file, camera or connection.

    Threads: one thread at a time.

    It is read once, from front to back, and holds no more than a few frames at a time. Made by
    `open_source`; opening decodes the first frame, so that what cannot be read fails there.

    Attributes
    ----------
    name : str
        The source as messages call it; never holds a password.
    fps : Fraction
        Frames a second, exact (30000/1001 stays what it is). With variable frame rate what
        the source announces, mostly the average; the truth is in `Frame.time`.
    length : int or None
        Number of frames as the source announces it, for progress bars; None where it does not.
    size_wh : (int, int)
        Width and height of every frame, pixels.
    facts : SourceFacts
        What else it says about itself, and what was lost so far.

    Raises
    ------
    StreamError
        While iterating: the source broke off. All frames before were delivered.
    FrameSizeError
        While iterating: a frame has another size than those before it.
    """

    def __init__(
        self,
        name: str,
        pictures: Pictures,
        *,
        fps: Fraction,
        length: int | None,
        facts: SourceFacts | None = None,
    ) -> None:
        first = next(pictures, None)
        if first is None:
            raise SourceError(f"{name}: no frame in it can be decoded; is it damaged or truncated?")
        self.name = name
        self.fps = fps
        self.length = length
        self.facts = facts or SourceFacts()
        self.size_wh = _size_wh(first[1])
        self._pictures = pictures
        self._frames = self._numbered(first)

    def __iter__(self) -> Iterator[Frame]:
        return self

    def __next__(self) -> Frame:
        return next(self._frames)

    def __enter__(self) -> Source:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the input; iteration is over afterwards. May be called twice."""
        self._frames.close()
        self._pictures.close()

    def _numbered(self, first: Picture) -> Generator[Frame, None, None]:
        yield Frame(0, *first)
        # The first picture would otherwise stay in memory as long as the source.
        del first
        for index, (time, image) in enumerate(self._pictures, start=1):
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
        f"{size_wh[0]}x{size_wh[1]}; split the source there or bring it to one size"
    )
