"""Training batches, and loading them ahead in worker processes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Final, NamedTuple, Protocol, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from ssiam.errors import SsiamError
from ssiam.geometry import Image

__all__ = [
    "SEARCH_CROP",
    "TEMPLATE_CROP",
    "AnyBatch",
    "Batch",
    "BatchSampler",
    "MaskBatch",
    "Pair",
    "TeacherResponses",
    "collate",
    "load_batches",
    "planes",
]

TEMPLATE_CROP: Final = 127  # px, side of the template crop
SEARCH_CROP: Final = 255  # px, side of the search crop

_AHEAD: Final = 2  # batches that each worker prepares before they are requested

Bytes: TypeAlias = NDArray[np.uint8]
Floats: TypeAlias = NDArray[np.float32]
Flags: TypeAlias = NDArray[np.bool_]


class Pair(NamedTuple):
    """A template and a search crop.

    Attributes
    ----------
    template, search : (127, 127, 3), (255, 255, 3) uint8 BGR
    box : (4,) float32
        cx, cy, w, h of the target, px of the search crop from its middle pixel; zeros if the
        target is not present.
    present : bool
        Whether the search crop shows the target.
    recent : (127, 127, 3) uint8 BGR, optional
        A later view of the target; None if the template is also the recent one.
    template_wh : (float, float)
        Size of the target in the template crop, px.
    """

    template: Image
    search: Image
    box: Floats
    present: bool
    recent: Image | None = None
    template_wh: tuple[float, float] = (0.0, 0.0)


class TeacherResponses(NamedTuple):
    """Responses of a teacher to N pairs, on the 15 x 15 cells of `ssiam.networks.lite`.

    Attributes
    ----------
    score : (N, 15, 15) float32
        Probability that the cell is on the target.
    boxes : (N, 4, 15, 15) float32
        Left, top, right, bottom, px from the search crop's middle pixel.
    weight : (N,) float32
        0 for pairs on which no teacher is right, else 1.
    """

    score: Floats
    boxes: Floats
    weight: Floats


@dataclass
class Batch:
    """N pairs of crops with their labels.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    template : (N, 3, 127, 127) uint8 BGR
    search : (N, 3, 255, 255) uint8 BGR
    box : (N, 4) float32
        cx, cy, w, h of the target, px of the search crop from its middle pixel (127, 127); zeros
        if the target is not present.
    present : (N,) bool
    weight : (N,) float32
    recent : (N, 3, 127, 127) uint8 BGR, optional
    template_wh : (N, 2) float32, optional
        Size of the target in the template crop, px.
    teacher : TeacherResponses, optional
    """

    template: Bytes
    search: Bytes
    box: Floats
    present: Flags
    weight: Floats
    recent: Bytes | None = None
    template_wh: Floats | None = None
    teacher: TeacherResponses | None = None

    def __len__(self) -> int:
        """Number of pairs."""
        return len(self.template)


@dataclass
class MaskBatch:
    """N crops with their masks, for `ssiam.networks.box_mask`.

    Attributes
    ----------
    crop : (N, 3, 128, 128) uint8 BGR
    mask : (N, 64, 64) uint8
        Covered fraction of each cell of 2 x 2 px, 0..255.
    """

    crop: Bytes
    mask: Bytes

    def __len__(self) -> int:
        """Number of crops."""
        return len(self.crop)


AnyBatch: TypeAlias = Batch | MaskBatch


class BatchSampler(Protocol):
    """Draws the batch of a step; a pure function of the step, so that runs can be resumed."""

    def batch(self, step: int, size: int) -> AnyBatch:
        """A batch of `size` pairs or crops."""


def collate(pairs: Sequence[Pair]) -> Batch:
    """The pairs as one batch, each with weight 1."""
    return Batch(
        template=planes([pair.template for pair in pairs]),
        search=planes([pair.search for pair in pairs]),
        box=np.stack([pair.box for pair in pairs]),
        present=np.array([pair.present for pair in pairs]),
        weight=np.ones(len(pairs), dtype=np.float32),
        recent=_recent(pairs),
        template_wh=np.array([pair.template_wh for pair in pairs], dtype=np.float32),
    )


def planes(images: Sequence[Image]) -> Bytes:
    """Images (H, W, 3) as one contiguous array (N, 3, H, W)."""
    return np.ascontiguousarray(np.stack(images).transpose(0, 3, 1, 2))


def _recent(pairs: Sequence[Pair]) -> Bytes | None:
    if all(pair.recent is None for pair in pairs):
        return None
    return planes([pair.template if pair.recent is None else pair.recent for pair in pairs])


def load_batches(
    sampler: BatchSampler, steps: range, size: int, workers: int = 0
) -> Iterator[AnyBatch]:
    """Yield the batch of every step, in order; the number of workers does not change them.

    Parameters
    ----------
    sampler : BatchSampler
        Pickled if there are workers.
    steps : range
    size : int
        Pairs or crops of a batch.
    workers : int
        Number of processes that draw batches ahead; 0 draws each batch in this process when it
        is requested. A script that uses workers must be guarded by ``if __name__ == "__main__"``.

    Raises
    ------
    DatasetError
        Raised by the sampler.
    SsiamError
        A worker process was killed.
    """
    if not workers:
        yield from (sampler.batch(step, size) for step in steps)
        return
    # Forked processes can deadlock on the threads of OpenVINO and PyTorch.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _init_worker, (sampler,))
    try:
        yield from _in_order(pool, steps, size, _AHEAD * workers)
    except BrokenProcessPool:
        raise SsiamError(
            "a process that loads training data was killed; is there enough memory? "
            "Try fewer workers"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


def _in_order(pool: ProcessPoolExecutor, steps: range, size: int, ahead: int) -> Iterator[AnyBatch]:
    pending: deque[Future[AnyBatch]] = deque()
    for step in steps:
        pending.append(pool.submit(_draw, step, size))
        if len(pending) > ahead:
            yield pending.popleft().result()
    while pending:
        yield pending.popleft().result()


_worker_sampler: BatchSampler | None = None


def _init_worker(sampler: BatchSampler) -> None:
    global _worker_sampler
    cv2.setNumThreads(1)
    _worker_sampler = sampler


def _draw(step: int, size: int) -> AnyBatch:
    assert _worker_sampler is not None
    return _worker_sampler.batch(step, size)
