"""`Past`: the steps of the last moments, so that a box drawn into one of them is in time."""

from __future__ import annotations

from collections import deque
from itertools import pairwise
from typing import Final

import numpy as np

from ssiam.web.errors import CommandError
from ssiam.web.step import Step

_SECONDS: Final = 1.0  # for which steps are kept that nobody draws into
_HELD_SECONDS: Final = 60.0  # and while somebody does
_BYTES: Final = 96 * 2**20  # of pictures; beyond it every second step is let go
_HOLDS: Final = 16  # steps that are held at a time
_CATCH_UP: Final = 24  # steps that a new target is taken through


class Past:
    """Keeps steps, and those since one into which somebody draws.

    A person needs seconds for a box, in which the camera goes on. Pictures are kept for so long,
    fewer of them the longer it takes, and the new target is taken through them.
    """

    def __init__(self) -> None:
        self._steps: deque[Step] = deque()
        self._held: dict[int, float] = {}  # number of a step -> until when it is kept

    def keep(self, step: Step) -> None:
        """Take in the newest step."""
        self._steps.append(step)
        self._held = {n: until for n, until in self._held.items() if until > step.done}
        first = min(self._held, default=step.number)
        while self._steps[0].number < first and self._steps[0].done < step.done - _SECONDS:
            self._steps.popleft()
        if sum(each.frame.image.nbytes for each in self._steps) > _BYTES:
            self._thin_out()

    def hold(self, number: int) -> None:
        """Keep step `number`, if it is still there, and what follows it."""
        if len(self._held) >= _HOLDS:
            del self._held[min(self._held)]
        self._held[number] = self._steps[-1].done + _HELD_SECONDS if self._steps else 0.0

    def since(self, number: int | None) -> list[Step]:
        """Step `number` (None: the newest) and those after it, not too many, one of each frame.

        Raises
        ------
        CommandError
            That step is no longer there.
        """
        if number is None:
            number = self._steps[-1].number if self._steps else 0
        self._held.pop(number, None)
        steps = [step for step in self._steps if step.number >= number]
        if not steps or steps[0].number != number:
            raise CommandError("too-old", f"step {number} is no longer there: draw the box anew")
        apart = [steps[0], *(b for a, b in pairwise(steps) if a.frame is not b.frame)]
        chosen = np.unique(np.linspace(0, len(apart) - 1, _CATCH_UP).round().astype(int))
        return [apart[place] for place in chosen]

    def forget(self) -> None:
        """Let go of all steps."""
        self._steps.clear()
        self._held.clear()

    def _thin_out(self) -> None:
        """Let every second step go that nobody holds, the newest excepted."""
        newest = self._steps.pop()
        kept = (s for n, s in enumerate(self._steps) if n % 2 == 0 or s.number in self._held)
        self._steps = deque([*kept, newest])
