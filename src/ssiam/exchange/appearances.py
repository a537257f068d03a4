"""`appearances`: when a target is seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ssiam.exchange.annotations import Annotation


def appearances(rows: Sequence[Annotation]) -> Iterator[list[Annotation]]:
    """The unbroken runs of frames in which one target is seen; its rows in the order of frames."""
    run: list[Annotation] = []
    for row in rows:
        if run and (not row.seen or row.frame != run[-1].frame + 1):
            yield run
            run = []
        if row.seen:
            run.append(row)
    if run:
        yield run
