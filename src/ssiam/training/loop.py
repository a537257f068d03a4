"""A whole training run: from wherever its folder stands to the exported network."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

from torch import Tensor

from ssiam.outputs import make_folder
from ssiam.training.batches import Batch
from ssiam.training.checkpoints import read_state, write_state
from ssiam.training.finished import write_network
from ssiam.training.mask_crops import MaskBatch
from ssiam.training.memory import keep_freed_memory
from ssiam.training.metrics import Metrics
from ssiam.training.settings import TrainSettings
from ssiam.training.trainer import Trainer
from ssiam.training.validation import validate

__all__ = ["Batches", "Report", "train"]

Batches: TypeAlias = Callable[[range], Iterator[Batch | MaskBatch]]
Report: TypeAlias = Callable[[int, dict[str, float]], None]


def train(settings: TrainSettings, batches: Batches, folder: Path, report: Report) -> None:
    """Train to the last step, and write the averaged network.

    A checkpoint is written every few minutes; the same call goes on from the last one.

    Parameters
    ----------
    settings : TrainSettings
    batches : callable
        The batches of a range of steps, in order.
    folder : Path
        Of checkpoint.pth, metrics.csv and at last weights.pth and the .onnx pieces; made if it is
        not there.
    report : callable
        Told the step and the metrics of every row.

    Raises
    ------
    SinkError
        The folder cannot be written.
    WeightsError
        The checkpoint in it, or the weights to start from, are damaged.
    ArgumentError
        The folder holds a run with other settings.
    """
    make_folder(folder)
    state = read_state(folder, settings)
    keep_freed_memory()
    trainer = Trainer(settings)
    if state is not None:
        trainer.go_on(state)
    with Metrics(folder, trainer.step) as metrics:
        run = _Run(settings, trainer, folder, metrics, report)
        for batch in batches(range(trainer.step, settings.steps)):
            run.step(batch)
    write_network(trainer.average.network, folder)


class _Run:
    """What happens after each step: rows of metrics, validation, checkpoints."""

    def __init__(
        self,
        settings: TrainSettings,
        trainer: Trainer,
        folder: Path,
        metrics: Metrics,
        report: Report,
    ) -> None:
        self._settings, self._trainer, self._folder = settings, trainer, folder
        self._metrics, self._report = metrics, report
        self._since = self._saved = time.monotonic()
        self._told = trainer.step
        self._sums: dict[str, Tensor] = {}

    def step(self, batch: Batch | MaskBatch) -> None:
        """Learn from a batch."""
        for name, loss in self._trainer.learn(batch).items():
            self._sums[name] = self._sums[name] + loss if name in self._sums else loss
        done = self._trainer.step
        last = done == self._settings.steps
        if done % self._settings.log_every == 0 or last:
            self._tell()
        validation = self._settings.validation
        if validation and (done % validation.every == 0 or last):
            self._write(validate(self._trainer.average.network, validation))
        if last or time.monotonic() - self._saved > self._settings.checkpoint_minutes * 60:
            write_state(self._folder, self._settings, self._trainer.state())
            self._saved = time.monotonic()

    def _tell(self) -> None:
        """One row each of the mean losses since the last time, and of the speed."""
        steps, now = self._trainer.step - self._told, time.monotonic()
        means = {name: float(value) / steps for name, value in self._sums.items()}
        speed = steps * self._settings.batch / max(now - self._since, 1e-9)
        self._write({**means, "loss": sum(means.values()), "pairs_per_second": speed})
        self._told, self._since, self._sums = self._trainer.step, now, {}

    def _write(self, values: dict[str, float]) -> None:
        step = self._trainer.step - 1
        self._metrics.write(step, values)
        self._report(step, values)
