"""Training: `Trainer` takes single steps, `train` runs from a folder's checkpoint to the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeAlias, cast

import torch
from torch import Tensor, nn
from torch.optim import AdamW

from ssiam.errors import WeightsError
from ssiam.networks.runners import TorchDevice, check_device
from ssiam.outputs import make_folder
from ssiam.training.checkpoints import (
    read_checkpoint,
    write_checkpoint,
    write_network,
)
from ssiam.training.data.batches import AnyBatch, BatchSampler, load_batches
from ssiam.training.data.mask_sampling import MaskSampler
from ssiam.training.data.pairs import PairSampler
from ssiam.training.data.registry import open_training_source
from ssiam.training.metrics import Metrics
from ssiam.training.optimizer import (
    WeightAverage,
    build_optimizer,
    keep_freed_memory,
    set_learning_rate,
)
from ssiam.training.settings import TrainSettings, ValidationSettings
from ssiam.training.students import build_student
from ssiam.training.teachers import DistillationSampler
from ssiam.training.validation import validate

__all__ = ["Batches", "Report", "Trainer", "load_optimizer", "train", "training_batches"]

_MAX_STEPS: Final = 2**53
# What PyTorch raises for a state of another form
_STATE_ERRORS: Final = (
    *(AssertionError, AttributeError, IndexError, KeyError, OverflowError, RuntimeError),
    *(TypeError, ValueError),
)
Batches: TypeAlias = Callable[[range], Iterator[AnyBatch]]
Report: TypeAlias = Callable[[int, dict[str, float]], None]


class Trainer:
    """A student with its optimizer and weight average.

    Sets the number of PyTorch's threads and its random seed.

    Parameters
    ----------
    settings : TrainSettings
    state : dict, optional
        The result of `state`, to resume from.
    device : str
        PyTorch's device of the network, its average, the optimizer, the batches and the losses.

    Attributes
    ----------
    average : WeightAverage
    step : int
        Number of steps done.

    Raises
    ------
    MissingExtraError, WeightsError
        The initial or the teacher's weights are missing or damaged, or the state is of another
        network.
    """

    def __init__(
        self, settings: TrainSettings, state: dict[str, Any] | None = None, device: str = "cpu"
    ) -> None:
        torch.set_num_threads(settings.threads)
        torch.manual_seed(settings.seed)
        self._settings = settings
        self._student = build_student(settings)
        # Its overloads differ between versions of PyTorch.
        cast(Any, self._student).to(device, memory_format=torch.channels_last)
        self.average = WeightAverage(self._student.network, settings.optimiser.average)
        self._optimizer = build_optimizer(self._student, settings.optimiser)
        self.step = 0
        if state is not None:
            self._load(state)

    def learn(self, batch: AnyBatch) -> dict[str, Tensor]:
        """Take the next step; return the losses by name, without gradients."""
        set_learning_rate(self._optimizer, self.step, self._settings)
        losses = self._student.losses(batch, self.step)
        self._optimizer.zero_grad()
        cast(Any, sum(losses.values())).backward()
        trained = [each for each in self._student.parameters() if each.grad is not None]
        nn.utils.clip_grad_norm_(trained, self._settings.optimiser.clip)
        self._optimizer.step()
        self.average.update(self._student.network, self.step)
        self.step += 1
        return {name: loss.detach() for name, loss in losses.items()}

    def state(self) -> dict[str, Any]:
        """Everything that changes from step to step, on the CPU; any device can resume from it."""
        state = {
            "step": self.step,
            "student": self._student.state_dict(),
            "average": self.average.network.state_dict(),
            "optimiser": self._optimizer.state_dict(),
            "random": torch.get_rng_state(),
        }
        return cast(dict[str, Any], _on_cpu(state))

    def _load(self, state: dict[str, Any]) -> None:
        try:
            self._student.load_state_dict(state["student"])
            self.average.network.load_state_dict(state["average"])
            load_optimizer(self._optimizer, state["optimiser"])
            torch.set_rng_state(state["random"])
            self.step = _checked_step(state["step"])
        except _STATE_ERRORS as error:
            raise WeightsError(
                "the checkpoint is of another network: train from the start in another folder"
            ) from error


def _on_cpu(state: Any) -> Any:
    """A copy of nested containers with all tensors on the CPU, where they may be the same."""
    if isinstance(state, Tensor):
        return state.cpu()
    if isinstance(state, dict):
        return {key: _on_cpu(each) for key, each in state.items()}
    return [_on_cpu(each) for each in state] if isinstance(state, list) else state


def load_optimizer(optimizer: AdamW, state: Any) -> None:
    """Load the state of the same optimizer in an earlier process.

    PyTorch accepts any numbers and shapes, and fails in a later step.

    Raises
    ------
    WeightsError
        The state is of other parameters or other settings, or is damaged.
    """
    try:
        groups = optimizer.state_dict()["param_groups"]
        for own, other in zip(groups, state["param_groups"], strict=True):
            for key in own.keys() & other.keys() - {"lr"}:  # set in each step
                if type(other[key]) is not type(own[key]) or other[key] != own[key]:
                    raise ValueError(key)
        parameters = [each for group in optimizer.param_groups for each in group["params"]]
        for number, moments in state["state"].items():
            for name, moment in moments.items():
                shape = () if name == "step" else parameters[number].shape
                if not moment.is_floating_point() or tuple(moment.shape) != tuple(shape):
                    raise ValueError(name)
        optimizer.load_state_dict(state)
    except _STATE_ERRORS as error:
        raise WeightsError(
            "the checkpoint has the state of another optimizer: train from the start in another "
            "folder"
        ) from error


def _checked_step(step: Any) -> int:
    if type(step) is not int or not 0 <= step < _MAX_STEPS:
        raise ValueError(f"step {step!r}")
    return step


def training_batches(settings: TrainSettings, root: Path | None = None) -> Batches:
    """Open the training data of a run.

    Parameters
    ----------
    settings : TrainSettings
    root : Path, optional
        Base of the settings' relative paths; None for the working directory.

    Returns
    -------
    callable
        Loads the batches of a range of steps, in order.

    Raises
    ------
    DatasetError
        A set is missing or damaged.
    ArgumentError
        No set has a weight above 0.
    """
    settings = settings.located(root)
    sources = [open_training_source(each) for each in settings.sources]
    sampler: BatchSampler
    if settings.network.kind == "mask":
        sampler = MaskSampler(sources, settings.pairs, settings.seed)
    else:
        sampler = pairs = PairSampler(sources, settings.pairs, settings.seed)
        if settings.teacher is not None:
            sampler = DistillationSampler(pairs, settings.teacher)
    return partial(load_batches, sampler, size=settings.batch, workers=settings.workers)


def train(
    settings: TrainSettings,
    batches: Batches,
    folder: Path,
    report: Report,
    device: TorchDevice = "cpu",
    root: Path | None = None,
) -> None:
    """Train to the last step and write the averaged network.

    A checkpoint is written every few minutes; the same call resumes from it.

    Parameters
    ----------
    settings : TrainSettings
    batches : callable
        Gives the batches of a range of steps, in order; see `training_batches`.
    folder : Path
        Receives checkpoint.pth, metrics.csv and finally weights.pth and the ONNX pieces; created
        if it does not exist.
    report : callable
        Called with the step and the metrics, whenever metrics are written.
    device : {"cpu", "cuda", "mps"}
        Where the network is trained. It is validated on the CPU.
    root : Path, optional
        Base of the settings' relative paths; None for the working directory.

    Raises
    ------
    SinkError
        The folder cannot be written.
    WeightsError
        The checkpoint or the initial weights are damaged.
    ArgumentError
        The folder holds a run with other settings, or the device is not available.
    """
    check_device(device)
    make_folder(folder)
    state = read_checkpoint(folder, settings)
    keep_freed_memory()
    located = settings.located(root)
    trainer = Trainer(located, state, device)
    with Metrics(folder, trainer.step) as metrics:
        loop = _Loop(settings, trainer, folder, metrics, report, located.validation)
        for batch in batches(range(trainer.step, settings.steps)):
            loop.step(batch)
    write_network(trainer.average.on_cpu(), folder)


class _Loop:
    """Trains step by step; writes metrics, validation results and checkpoints when due."""

    def __init__(
        self,
        settings: TrainSettings,
        trainer: Trainer,
        folder: Path,
        metrics: Metrics,
        report: Report,
        validation: ValidationSettings | None,
    ) -> None:
        self._validation = validation
        self._settings, self._trainer, self._folder = settings, trainer, folder
        self._metrics, self._report = metrics, report
        self._logged_at = self._saved_at = time.monotonic()
        self._logged_step = trainer.step
        self._sums: dict[str, Tensor] = {}

    def step(self, batch: AnyBatch) -> None:
        """Train on a batch."""
        for name, loss in self._trainer.learn(batch).items():
            self._sums[name] = self._sums[name] + loss if name in self._sums else loss
        done = self._trainer.step
        last = done == self._settings.steps
        if done % self._settings.log_every == 0 or last:
            self._log_losses()
        validation = self._validation
        if validation and (done % validation.every == 0 or last):
            self._write(validate(self._trainer.average.on_cpu(), validation))
        minutes = (time.monotonic() - self._saved_at) / 60
        if last or minutes > self._settings.checkpoint_minutes:
            write_checkpoint(self._folder, self._settings, self._trainer.state())
            self._saved_at = time.monotonic()

    def _log_losses(self) -> None:
        """Write the mean losses since the last call, and the speed."""
        steps, now = self._trainer.step - self._logged_step, time.monotonic()
        means = {name: float(value) / steps for name, value in self._sums.items()}
        speed = steps * self._settings.batch / max(now - self._logged_at, 1e-9)
        self._write({**means, "loss": sum(means.values()), "pairs_per_second": speed})
        self._logged_step, self._logged_at, self._sums = self._trainer.step, now, {}

    def _write(self, values: dict[str, float]) -> None:
        step = self._trainer.step - 1
        self._metrics.write(step, values)
        self._report(step, values)
