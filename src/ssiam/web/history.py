"""`StepHistory`: recent steps, so that a box can be drawn into an earlier frame."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import Final

import numpy as np

from ssiam.web.types import CommandError, Step

_KEPT_SECONDS: Final = 1.0  # how long steps are kept by default
_HELD_SECONDS: Final = 60.0  # how long held steps, and those after them, are kept
_MAX_BYTES: Final = 96 * 2**20  # of images; beyond it, every second step is dropped
_MAX_HOLDS: Final = 16  # steps that are held at a time
_MAX_REPLAYED: Final = 24  # steps through which a new target is tracked


class StepHistory:
    """Recent steps, and those since a step that is held.

    Drawing a box takes a user some seconds, during which the source continues. The step into which
    the box is drawn is held, with the steps after it; they are thinned out as they become many. The
    new target is tracked through them to the newest frame.
    """

    def __init__(self) -> None:
        self._steps: deque[Step] = deque()
        self._held: dict[int, float] = {}  # step number -> time at which the hold expires

    def append(self, step: Step) -> None:
        """Add the newest step, and drop those that have expired."""
        self._steps.append(step)
        self._held = {n: until for n, until in self._held.items() if until > step.done}
        first = min(self._held, default=step.number)
        while self._steps[0].number < first and self._steps[0].done < step.done - _KEPT_SECONDS:
            self._steps.popleft()
        if sum(each.frame.image.nbytes for each in self._steps) > _MAX_BYTES:
            self._thin_out()

    def hold(self, number: int) -> None:
        """Keep step `number`, if it is still available, and the steps after it."""
        if len(self._held) >= _MAX_HOLDS:
            del self._held[min(self._held)]
        self._held[number] = self._steps[-1].done + _HELD_SECONDS if self._steps else 0.0

    def since(self, number: int | None) -> list[Step]:
        """Step `number` and a sample of those after it, one per frame; the hold is released.

        None stands for the newest step. The first and the last step are always in the sample.

        Raises
        ------
        CommandError
            The step is no longer available.
        """
        if number is None:
            number = self._steps[-1].number if self._steps else 0
        self._held.pop(number, None)
        steps = [step for step in self._steps if step.number >= number]
        if not steps or steps[0].number != number:
            raise CommandError(
                "too-old", f"step {number} is no longer available: draw the box again"
            )
        distinct = [steps[0], *(b for a, b in pairwise(steps) if a.frame is not b.frame)]
        chosen = np.unique(np.linspace(0, len(distinct) - 1, _MAX_REPLAYED).round().astype(int))
        return [distinct[index] for index in chosen]

    def clear(self) -> None:
        """Drop all steps and holds."""
        self._steps.clear()
        self._held.clear()

    def _thin_out(self) -> None:
        """Drop every second step that is not held, except the newest."""
        newest = self._steps.pop()
        rest = (s for n, s in enumerate(self._steps) if n % 2 == 0 or s.number in self._held)
        self._steps = deque([*rest, newest])
