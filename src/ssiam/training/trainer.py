"""`Trainer`: one step of learning, and all that has to be kept to go on after it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn

from ssiam.errors import WeightsError
from ssiam.runtime.openvino import supports_bf16
from ssiam.training.batches import Batch
from ssiam.training.ema import Average
from ssiam.training.lite2_student import Lite2Student
from ssiam.training.losses import Truth, pair_losses
from ssiam.training.mask_crops import MaskBatch
from ssiam.training.mask_student import MaskStudent
from ssiam.training.optimiser import build_optimiser, set_rate
from ssiam.training.settings import TeacherSettings, TrainSettings
from ssiam.training.student import Student
from ssiam.training.teacher import Teacher, lesson_losses

__all__ = ["Trainer"]


class Trainer:
    """A network in training: weights, their average, and the optimiser's memory.

    PyTorch's threads are set as the settings say, and its random numbers to their seed.

    Parameters
    ----------
    settings : TrainSettings

    Raises
    ------
    MissingExtraError, WeightsError
        The backbone's or the teacher's weights are not there or damaged.
    """

    def __init__(self, settings: TrainSettings) -> None:
        torch.set_num_threads(settings.threads)
        torch.manual_seed(settings.seed)
        self._settings = settings
        # Depthwise convolutions, of which "lite2" has most, take longer in bf16.
        self._bf16 = settings.network.kind == "lite" and _quick_in_bf16()
        teacher = settings.teacher
        self._teacher = None
        self._student: Student | Lite2Student | MaskStudent
        if settings.network.kind == "lite2":
            self._student = Lite2Student(settings)
        elif settings.network.kind == "mask":
            self._student = MaskStudent(settings.network)
        else:
            self._teacher = None if teacher is None else _teacher(teacher, settings.threads)
            self._student = Student(
                settings.network,
                taught=teacher is not None,
                threads=settings.threads,
                precision="bf16" if supports_bf16() else "f32",
            )
        # Its overloads differ between versions of PyTorch.
        cast(Any, self._student).to(memory_format=torch.channels_last)
        self.average = Average(self._student.network, settings.optimiser.average)
        self._optimiser = build_optimiser(self._student, settings)
        self.step = 0

    def learn(self, batch: Batch | MaskBatch) -> dict[str, Tensor]:
        """Take the next step on a batch; the losses by name, without gradients."""
        self._student.prepare(self.step)
        set_rate(self._optimiser, self.step, self._settings)
        losses = self._losses(batch)
        self._optimiser.zero_grad()
        cast(Any, sum(losses.values())).backward()
        learning = [each for each in self._student.parameters() if each.grad is not None]
        nn.utils.clip_grad_norm_(learning, self._settings.optimiser.clip)
        self._optimiser.step()
        self.average.follow(self._student.network, self.step)
        self.step += 1
        return {name: loss.detach() for name, loss in losses.items()}

    def state(self) -> dict[str, Any]:
        """All that changes from step to step."""
        return {
            "step": self.step,
            "student": self._student.state_dict(),
            "average": self.average.network.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "random": torch.get_rng_state(),
        }

    def go_on(self, state: dict[str, Any]) -> None:
        """Be where `state` was taken; `WeightsError` if it is not one of such a trainer."""
        try:
            self._student.load_state_dict(state["student"])
            self.average.network.load_state_dict(state["average"])
            self._optimiser.load_state_dict(state["optimiser"])
            torch.set_rng_state(state["random"])
            self.step = int(state["step"])
        except (KeyError, RuntimeError, TypeError, ValueError) as error:
            raise WeightsError(
                "the checkpoint is not of this network: train from the start in another folder"
            ) from error

    def _losses(self, batch: Batch | MaskBatch) -> dict[str, Tensor]:
        if isinstance(batch, MaskBatch):
            assert isinstance(self._student, MaskStudent), "batches are of the network's kind"
            return self._student.losses(batch)
        if isinstance(self._student, Lite2Student):
            return self._student.losses(batch)
        assert isinstance(self._student, Student), "batches are of the network's kind"
        if self.step < self._settings.network.stem_alone:
            with self._arithmetic():
                return {"stem": self._student.stem_loss(batch.search)}
        with self._arithmetic():
            seen = self._student(batch.template, batch.search)
        # Losses are small differences of large sums: in float32.
        responses = type(seen.responses)(*(each.float() for each in seen.responses))
        losses = pair_losses(responses, _truth(batch), self._settings.losses)
        if self._teacher is None or self._settings.teacher is None or seen.adapted is None:
            return losses
        lesson = self._teacher.lesson(batch.template, batch.search)
        template, search = (each.float() for each in seen.adapted)
        taught = lesson_losses(lesson, responses, (template, search), self._settings.teacher)
        return losses | taught

    def _arithmetic(self) -> AbstractContextManager[Any]:
        return torch.autocast("cpu", torch.bfloat16) if self._bf16 else nullcontext()


def _quick_in_bf16() -> bool:
    """Whether PyTorch learns faster in bf16: without AMX its gradients take twice as long."""
    tell: Callable[[], dict[str, Any]] = getattr(torch.cpu, "get_capabilities", dict)
    return bool(tell().get("amx_bf16", False))  # older versions tell nothing


def _teacher(settings: TeacherSettings, threads: int) -> Teacher:
    return Teacher(Path(settings.weights), threads)


def _truth(batch: Batch) -> Truth:
    return Truth(
        box=torch.from_numpy(batch.box),
        present=torch.from_numpy(batch.present),
        mask=torch.from_numpy(batch.mask).float() / 255,
        masked=torch.from_numpy(batch.masked),
        weight=torch.from_numpy(batch.weight),
    )
