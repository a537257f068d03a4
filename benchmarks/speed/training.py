"""Speed of `ssiam train`: pairs per CPU second, and which parts of a step take the time.

    python benchmarks/speed/training.py CONFIG [--steps N] [--first N]

Draws the batches and trains in one process with one thread, so that the CPU time of the process is
that of a training process and one worker together. CPU time is measured because it depends less on
what else runs on the machine. The first two steps are not counted, because they load the teachers.
The config's sources, weights and teachers are read; nothing is written. To compare checkouts, run
the script with PYTHONPATH set to the src of each, in turns.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import torch

from ssiam.training import teachers, trainer
from ssiam.training.config import read_config
from ssiam.training.data import images, pairs, tracks
from ssiam.training.optimizer import keep_freed_memory
from ssiam.training.students import LiteStudent

UNCOUNTED = 2  # steps
# Functions by the part of a step that they are; time in a function of another part is not theirs.
PARTS: dict[str, list[tuple[Any, str]]] = {
    "decode images": [(images, "read_image")],
    "decode masks": [(tracks, "read_labels"), (tracks.LabelTrack, "mask"), (tracks, "box_of_mask")],
    "crop": [(pairs, "crop_image")],
    "augment": [
        (pairs, name)
        for name in (
            *("augment_crop", "coarsen", "draw_shake", "motion_blur", "occlude", "to_grayscale"),
        )
    ],
    "sample and collate": [(pairs.PairSampler, "batch")],
    "teacher NanoTrack v3": [(teachers._NanoTrackTeacher, "__call__")],
    "teacher FEAR-XS": [(teachers._FearTeacher, "__call__")],
    "choose the teacher": [(teachers.Teachers, "responses")],
    "student, frozen layers": [(LiteStudent, "_lower")],
    "student, forward and losses": [(LiteStudent, "losses")],
    "backward": [(torch.Tensor, "backward")],
    "optimizer and average": [(trainer.Trainer, "learn")],
}


class PartTimer:
    """CPU seconds of each part, without those of the parts that it calls."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self._running: list[str] = ["other"]
        self._since = time.process_time()

    def install(self) -> None:
        """Measure all functions of `PARTS` from now on."""
        for part, functions in PARTS.items():
            for owner, name in functions:
                setattr(owner, name, self._measured(part, getattr(owner, name)))

    def _measured(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            self._switch()
            self._running.append(part)
            try:
                return function(*args, **kwargs)
            finally:
                self._switch()
                self._running.pop()

        return call

    def _switch(self) -> None:
        now = time.process_time()
        self.seconds[self._running[-1]] += now - self._since  # type: ignore[assignment]
        self._since = now


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="first step")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    settings = replace(read_config(arguments.config), workers=0, threads=1)
    keep_freed_memory()
    timer = PartTimer()
    timer.install()
    learner = trainer.Trainer(settings)
    first, steps = arguments.first, arguments.steps
    begin = 0.0
    for number, batch in enumerate(
        trainer.training_batches(settings)(range(first, first + UNCOUNTED + steps))
    ):
        learner.learn(batch)
        if number + 1 == UNCOUNTED:
            timer.seconds.clear()
            begin = time.process_time()
    total = time.process_time() - begin
    print("| part | CPU ms per pair | share |\n|---|---|---|")
    for part, seconds in timer.seconds.most_common():
        print(f"| {part} | {1e3 * seconds / steps / settings.batch:.2f} | {seconds / total:.3f} |")
    print(f"\n{steps * settings.batch / total:.2f} pairs per CPU second")


if __name__ == "__main__":
    main()
