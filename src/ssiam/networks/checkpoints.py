"""Networks from the authors' checkpoint files (.pth), without running the code they may hold."""

from __future__ import annotations

import re
import struct
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ssiam.errors import WeightsError
from ssiam.networks.catalogue import NETWORKS, NetworkName, build_network
from ssiam.networks.recognition import COUNTERS, recognise
from ssiam.networks.renaming import renamed
from ssiam.networks.siamese import SiameseNetwork

__all__ = ["Checkpoint", "load_weights", "read_checkpoint", "read_content", "read_tensors"]

_WRAPPERS: Final = ("state_dict", "model")  # keys under which training stores the weights

# A training checkpoint's best accuracy may be a numpy scalar: these make numbers, nothing else.
_SCALAR: Final = np.float64(0).__reduce__()[0]
_NUMBERS: Final[list[Any]] = [
    *[(_SCALAR, f"numpy.{core}.multiarray.scalar") for core in ("core", "_core")],
    *[np.dtype, type(np.dtype(np.float64)), type(np.dtype(np.float32)), type(np.dtype(np.int64))],
]

# What unpickling raises for bytes that are cut or altered depends on where they are.
_DAMAGED: Final[tuple[type[Exception], ...]] = (
    *[AttributeError, EOFError, LookupError, OSError, RuntimeError, TypeError, ValueError],
    *[UnpicklingError, struct.error],
)


class Checkpoint(NamedTuple):
    """A network and its name; it unpacks as (name, network).

    Threads: a value; any number of threads may share it.
    """

    name: NetworkName
    network: SiameseNetwork


def read_checkpoint(path: Path) -> Checkpoint:
    """The network of a checkpoint file, on the CPU and ready for inference.

    Which network it is is told from the weights. Taken are plain state dicts and those wrapped by
    training, with or without `module.` before the names, in PyTorch's zip format and the one
    before it, with the names of pysot, of foolwood's SiamMask, of siamfc-pytorch and of got-10k's
    older SiamFC. Code in the file is never run.

    Parameters
    ----------
    path : Path
        The .pth file.

    Raises
    ------
    WeightsError
        The file is missing, damaged, no checkpoint, or does not hold exactly the weights of one of
        `NETWORKS`; counters of training may be absent.
    """
    with _named(path):
        return load_weights(_weights(_content(path)))


def read_tensors(path: Path) -> dict[str, Tensor]:
    """The tensors of any network's checkpoint file by their names; errors as `read_checkpoint`."""
    with _named(path):
        return _weights(_content(path))


def read_content(path: Path) -> Any:
    """Whatever a file of PyTorch holds: tensors, numbers, text and containers, and never code.

    Raises `WeightsError` if it is missing, damaged or none.
    """
    with _named(path):
        return _content(path)


def load_weights(weights: Mapping[str, Tensor]) -> Checkpoint:
    """The network that has exactly these weights; `num_batches_tracked` may be absent.

    Raises `WeightsError`, its text without a subject, if there is none.
    """
    ours = renamed(weights)
    difference = recognise({key: tuple(value.shape) for key, value in ours.items()})
    if difference.network is None:
        raise WeightsError(
            f"are of no network known here ({difference}): "
            f"give the authors' checkpoint of one of {', '.join(NETWORKS)}"
        )
    if not difference.is_none:
        raise WeightsError(
            f"are not quite those of {difference.network}, the nearest network ({difference}): "
            "give the authors' own file of that network"
        )
    return Checkpoint(difference.network, _loaded(difference.network, ours))


def _loaded(name: NetworkName, weights: Mapping[str, Tensor]) -> SiameseNetwork:
    with torch.device("meta"):  # no time for random weights that are replaced at once
        network = build_network(name)
    counters = {key: torch.tensor(0) for key in network.state_dict() if key.endswith(COUNTERS)}
    floats = {key: value.float() for key, value in weights.items() if not key.endswith(COUNTERS)}
    network.load_state_dict({**floats, **counters}, strict=True, assign=True)
    return network


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Puts the file in front of the errors' text."""
    try:
        yield
    except WeightsError as error:
        raise WeightsError(f"weights {path} {error}") from error


def _check_start(path: Path) -> None:
    """Refuse what the first bytes already show to be no checkpoint."""
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
    if not zipfile.is_zipfile(path):  # its table of contents is at the end
        raise _damaged(path)
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
    if not any(name.endswith("/data.pkl") for name in names):
        raise WeightsError(
            f"are an archive of {len(names)} files ({names[0] if names else ''}), "
            "not a PyTorch checkpoint: unpack it and give the .pth file"
        )


def _content(path: Path) -> Any:
    """Whatever the file holds, as long as it is tensors, numbers, text and containers."""
    _check_start(path)
    try:
        with torch.serialization.safe_globals(_NUMBERS):
            return torch.load(path, map_location="cpu", weights_only=True)
    except _DAMAGED as error:
        code = re.search(r"GLOBAL ([\w.]+)\s", str(error))
        if code:
            raise WeightsError(
                f"hold code ({code[1]}) and were not loaded, for loading would run it: "
                "save the state dict alone, network.state_dict(), where you trust the file"
            ) from error
        raise _damaged(path) from error


def _damaged(path: Path) -> WeightsError:
    size = path.stat().st_size
    return WeightsError(f"are damaged or cut short ({size} bytes): download the file again")


def _weights(content: Any) -> dict[str, Tensor]:
    """The tensors of a state dict, out of the wrapper that training puts around it."""
    for wrapper in _WRAPPERS:
        if isinstance(content, Mapping) and isinstance(content.get(wrapper), Mapping):
            content = content[wrapper]
    if not isinstance(content, Mapping):
        raise WeightsError(f"hold a {type(content).__name__}, not a network's state dict")
    weights = {str(key): value for key, value in content.items() if isinstance(value, Tensor)}
    if not weights:
        raise WeightsError(
            f"hold no weights by name, only {', '.join(map(str, list(content)[:3])) or 'nothing'}: "
            "give the authors' .pth file of the network"
        )
    return weights
