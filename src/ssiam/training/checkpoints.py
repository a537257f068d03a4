"""Where a training run stands: one file, written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import torch

from ssiam.errors import ArgumentError, WeightsError
from ssiam.networks.checkpoints import read_content
from ssiam.outputs import atomic_write
from ssiam.training.config import from_table
from ssiam.training.settings import TrainSettings

__all__ = ["CHECKPOINT", "read_state", "write_file", "write_state"]

CHECKPOINT: Final = "checkpoint.pth"

State = dict[str, Any]


def write_state(folder: Path, settings: TrainSettings, state: Mapping[str, Any]) -> None:
    """Store a run's state, of tensors, numbers, texts and containers.

    Raises `SinkError` if that is not possible; the state that was there before is kept then.
    """
    content = {"settings": json.dumps(settings.identity(), sort_keys=True), **state}
    write_file(folder / CHECKPOINT, content)


def read_state(folder: Path, settings: TrainSettings) -> State | None:
    """The state of the run in a folder; None if there is none yet.

    Raises
    ------
    WeightsError
        The file is damaged, or no state of a run.
    ArgumentError
        It is of a run with other settings; the message names the first that differs.
    """
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    try:
        content = read_content(path)
        theirs = json.loads(content.pop("settings"))
    except (WeightsError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise WeightsError(
            f"checkpoint {path} is damaged: take it away to train from the start, "
            "or put back a copy of it"
        ) from error
    different = _different(_completed(theirs), _plain(settings))
    if different:
        raise ArgumentError(
            f"{folder} holds a run with other settings ({different}): "
            "give another folder with --out, or those settings"
        )
    return dict(content)


def write_file(path: Path, content: Any) -> None:
    """Store what PyTorch can store, so that a kill leaves the old file or the new one."""
    # PyTorch turns the error of a full disk into one that does not name it.
    data = BytesIO()
    torch.save(content, data)
    with atomic_write(path, "wb", hidden=True) as file:
        file.write(data.getbuffer())


def _plain(settings: TrainSettings) -> Any:
    return json.loads(json.dumps(settings.identity()))


def _completed(values: Any) -> Any:
    """A run's settings, where those that it could not have had yet have their default."""
    try:
        return _plain(from_table(TrainSettings, _without_none(values), ""))
    except (ArgumentError, AttributeError, TypeError):  # of a later version
        return values


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(each) for key, each in value.items() if each is not None}
    return [_without_none(each) for each in value] if isinstance(value, list) else value


def _different(theirs: Any, ours: Any, where: str = "") -> str:
    """The first value that differs, with its name; empty if none does."""
    if isinstance(theirs, list) and isinstance(ours, list):
        if len(theirs) != len(ours):
            return f"{where} are {len(theirs)} there and {len(ours)} here"
        pairs = zip(theirs, ours, strict=True)
        found = (_different(*pair, f"{where}[{i}]") for i, pair in enumerate(pairs))
    elif isinstance(theirs, dict) and isinstance(ours, dict):
        found = (
            _different(theirs.get(key), ours.get(key), f"{where}.{key}" if where else key)
            for key in sorted(theirs.keys() | ours.keys())
        )
    else:
        return "" if theirs == ours else f"{where} is {theirs!r} there and {ours!r} here"
    return next(filter(None, found), "")
