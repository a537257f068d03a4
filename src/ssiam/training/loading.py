"""`load_batches`: the batches of many steps in their order, drawn ahead by other processes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import TypeAlias

import cv2

from ssiam.errors import SsiamError
from ssiam.training.batches import Batch
from ssiam.training.mask_crops import MaskBatch, MaskSampler
from ssiam.training.pairs import PairSampler
from ssiam.training.tutors import TaughtSampler

AnyBatch: TypeAlias = Batch | MaskBatch
Sampler: TypeAlias = PairSampler | TaughtSampler | MaskSampler

# Batches that every worker has drawn or is drawing before the first of them is asked for.
_AHEAD = 2

_of_worker: Sampler | None = None


def load_batches(sampler: Sampler, steps: range, size: int, workers: int = 0) -> Iterator[AnyBatch]:
    """The batch of every step, in order; the same whatever the number of workers.

    Parameters
    ----------
    sampler : PairSampler, TaughtSampler or MaskSampler
    steps : range
    size : int
        Pairs of a batch.
    workers : int
        Processes that draw; 0: none, each batch is drawn when it is asked for. A script that
        asks for some has to be guarded by ``if __name__ == "__main__"``.

    Raises
    ------
    DatasetError
        As `PairSampler.batch`.
    SsiamError
        A worker was ended from outside.
    """
    if not workers:
        yield from (sampler.batch(step, size) for step in steps)
        return
    # Forked processes may hang on the threads that the networks' libraries have started.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _start, (sampler,))
    try:
        yield from _in_order(pool, steps, size, _AHEAD * workers)
    except BrokenProcessPool:
        raise SsiamError(
            "a process that draws training data was ended; is there enough memory? "
            "Try fewer workers"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


def _in_order(pool: ProcessPoolExecutor, steps: range, size: int, ahead: int) -> Iterator[AnyBatch]:
    coming: deque[Future[AnyBatch]] = deque()
    for step in steps:
        coming.append(pool.submit(_draw, step, size))
        if len(coming) > ahead:
            yield coming.popleft().result()
    while coming:
        yield coming.popleft().result()


def _start(sampler: Sampler) -> None:
    global _of_worker
    cv2.setNumThreads(1)
    _of_worker = sampler


def _draw(step: int, size: int) -> AnyBatch:
    assert _of_worker is not None
    return _of_worker.batch(step, size)
