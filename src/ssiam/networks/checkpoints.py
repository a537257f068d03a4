"""Networks from the authors' checkpoint files (.pth), without running code from the files."""

from __future__ import annotations

import pickletools
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ssiam.errors import WeightsError
from ssiam.networks.base import SiameseNetwork
from ssiam.networks.registry import NETWORKS, NetworkName, build_network
from ssiam.networks.state_dicts import COUNTERS, FOOLWOOD, PARALLEL, recognize, rename_keys

__all__ = [
    "Checkpoint",
    "is_of_siammask_authors",
    "network_from_state_dict",
    "read_checkpoint",
    "read_state_dict",
    "read_torch_file",
]

_LEGACY_PICKLES: Final = 5  # before the numbers of a file in the legacy format
# Operations of pickles that name code or other objects; names of Python's have less than 100
_NAMING: Final = frozenset({"GLOBAL", "INST", "PERSID", "STACK_GLOBAL"})
_MAX_NAME: Final = 300  # characters
# Ends the two names of an operation that go on to the end of the file, as PyTorch reads them.
_LINE_ENDS: Final = b"\n\n"
_MAX_KEY: Final = 40  # characters of a key that a message quotes
_WRAPPERS: Final = ("state_dict", "model")  # keys under which training scripts store the weights

# Training checkpoints may hold NumPy scalars, such as the best accuracy. Unpickling these globals
# only creates numbers.
_SCALAR: Final = np.float64(0).__reduce__()[0]
_NUMBERS: Final[list[Any]] = [
    *[(_SCALAR, f"numpy.{core}.multiarray.scalar") for core in ("core", "_core")],
    *[np.dtype, type(np.dtype(np.float64)), type(np.dtype(np.float32)), type(np.dtype(np.int64))],
]


class Checkpoint(NamedTuple):
    """A tuple (name, network).

    Threads: a value; any number of threads may share it.
    """

    name: NetworkName
    network: SiameseNetwork


def read_checkpoint(path: Path) -> Checkpoint:
    """The network of a checkpoint file, on the CPU and ready for inference.

    The network is recognized by the names and shapes of its weights. Accepted are state dicts and
    training checkpoints that contain one, with or without the prefix `module.`, in PyTorch's zip
    or legacy format, with the key names of pysot, foolwood's SiamMask, siamfc-pytorch or got-10k's
    older SiamFC. Code in the file is never run.

    Parameters
    ----------
    path : Path
        The .pth file.

    Returns
    -------
    Checkpoint
        The name of the network, one of `NETWORKS`, and the network.

    Raises
    ------
    WeightsError
        The file is missing, damaged or not a checkpoint, or its weights are not exactly those of
        one of `NETWORKS`. Only `num_batches_tracked` may be absent.
    """
    with _file_in_messages(path):
        return network_from_state_dict(_state_dict(_read_content(path)))


def read_state_dict(path: Path) -> dict[str, Tensor]:
    """The tensors of any network's checkpoint file, by name.

    Raises `WeightsError` if the file is missing, damaged or not a checkpoint.
    """
    with _file_in_messages(path):
        return _state_dict(_read_content(path))


def is_of_siammask_authors(path: Path) -> bool:
    """Whether a checkpoint of SiamMask is from its authors' repository, and not from pysot.

    Both have the same network under other key names. Raises `WeightsError` as `read_state_dict`.
    """
    return any(key.removeprefix(PARALLEL).startswith(FOOLWOOD) for key in read_state_dict(path))


def read_torch_file(path: Path) -> Any:
    """The content of a PyTorch file: tensors, numbers, text and containers, never code.

    Raises `WeightsError` if the file is missing, damaged or not a PyTorch file.
    """
    with _file_in_messages(path):
        return _read_content(path)


def network_from_state_dict(weights: Mapping[str, Tensor]) -> Checkpoint:
    """The network that has exactly these weights; `num_batches_tracked` may be absent.

    Raises `WeightsError` if there is none. The message starts with a verb; the caller adds the
    subject, the file.
    """
    ours = rename_keys(weights)
    difference = recognize({key: tuple(value.shape) for key, value in ours.items()})
    if difference.network is None:
        raise WeightsError(
            f"are not those of a known network ({difference}): "
            f"give the authors' checkpoint of one of {', '.join(NETWORKS)}"
        )
    if not difference.is_empty:
        raise WeightsError(
            f"differ from those of {difference.network}, the nearest network ({difference}): "
            "give the authors' own file of that network"
        )
    return Checkpoint(difference.network, _build_with(difference.network, ours))


def _build_with(name: NetworkName, weights: Mapping[str, Tensor]) -> SiameseNetwork:
    for key, value in weights.items():
        if value.is_meta or value.is_complex() or value.layout is not torch.strided:
            raise WeightsError(f"hold no plain numbers for {key}: give the authors' own file")
    with torch.device("meta"):  # the random weights would be replaced immediately
        network = build_network(name)
    counters = {key: torch.tensor(0) for key in network.state_dict() if key.endswith(COUNTERS)}
    floats = {key: value.float() for key, value in weights.items() if not key.endswith(COUNTERS)}
    network.load_state_dict({**floats, **counters}, strict=True, assign=True)
    return network


@contextmanager
def _file_in_messages(path: Path) -> Iterator[None]:
    """Put the file in front of the message of a `WeightsError`."""
    try:
        yield
    except WeightsError as error:
        raise WeightsError(f"weights {path} {error}") from error


def _check_first_bytes(path: Path) -> None:
    """Refuse a file that cannot be a checkpoint by its first bytes."""
    if path.is_dir():
        raise WeightsError("are a folder: give the .pth file in it")
    if not path.is_file():
        raise WeightsError("do not exist: give the path of a .pth file")
    with path.open("rb") as file:
        start = file.read(64)
    if not start:
        raise WeightsError("are empty (0 bytes): download the file again")
    if start.lstrip().startswith(b"<"):
        raise WeightsError(
            f"are a web page (they start with {start.lstrip()[:14]!r}), "
            "not a checkpoint: download the file itself"
        )
    if start.startswith(b"PK"):
        _check_archive(path)
    elif not start.startswith(b"\x80"):  # pickle's PROTO
        raise WeightsError(
            f"are not a PyTorch checkpoint (they start with {start[:8]!r}): "
            "give the authors' .pth file"
        )


def _check_archive(path: Path) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
        raise _damaged(path) from error
    names = [entry.filename for entry in entries]
    if not any(name.endswith("/data.pkl") for name in names):
        raise WeightsError(
            f"are an archive of {len(names)} files ({names[0] if names else ''}), "
            "not a PyTorch checkpoint: unpack it and give the .pth file"
        )
    declared, size = sum(entry.file_size for entry in entries), path.stat().st_size
    if declared > size:  # PyTorch does not compress
        raise WeightsError(
            f"are compressed: {size} bytes would become {declared}; load the file where you trust "
            "it, and save its state dict with torch.save"
        )


def _read_content(path: Path) -> Any:
    """The content of a file of tensors, numbers, text and containers."""
    _check_first_bytes(path)
    _check_names(path)
    try:
        with torch.serialization.safe_globals(_NUMBERS):
            return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # which one altered bytes raise depends on their position
        code = re.search(r"GLOBAL ([\w.]+)\s", str(error))
        if code:
            raise WeightsError(
                f"hold code ({code[1]}) and were not loaded, because loading would run it: "
                "if you trust the file, save only its state dict, network.state_dict()"
            ) from error
        raise _damaged(path) from error


def _check_names(path: Path) -> None:
    """Refuse pickles with very long names: PyTorch takes minutes to put them into a message."""
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                name = next(each for each in archive.namelist() if each.endswith("/data.pkl"))
                pickles = [BytesIO(archive.read(name) + _LINE_ENDS)]
        else:
            pickles = [BytesIO(path.read_bytes() + _LINE_ENDS)] * _LEGACY_PICKLES
        for pickle in pickles:
            for operation, argument, _ in pickletools.genops(pickle):
                if operation.name in _NAMING and len(str(argument)) > _MAX_NAME:
                    raise _damaged(path)
    except WeightsError:
        raise
    except Exception:  # reported when PyTorch reads it
        return


def _damaged(path: Path) -> WeightsError:
    size = path.stat().st_size
    return WeightsError(f"are damaged or cut short ({size} bytes): download the file again")


def _state_dict(content: Any) -> dict[str, Tensor]:
    """The tensors of a state dict, or of a training checkpoint that contains one."""
    for wrapper in _WRAPPERS:
        if isinstance(content, Mapping) and isinstance(content.get(wrapper), Mapping):
            content = content[wrapper]
    if not isinstance(content, Mapping):
        raise WeightsError(f"hold a {type(content).__name__}, not a network's state dict")
    weights = {
        key: value
        for key, value in content.items()
        if isinstance(key, str) and isinstance(value, Tensor)
    }
    if not weights:
        raise WeightsError(
            f"hold no named weights, only {_first_keys(content) or 'nothing'}: "
            "give the authors' .pth file of the network"
        )
    return weights


def _first_keys(content: Mapping[Any, Any]) -> str:
    keys = [key if isinstance(key, str) else type(key).__name__ for key in list(content)[:3]]
    return ", ".join(key[:_MAX_KEY] for key in keys)
