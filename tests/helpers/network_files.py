"""State dicts of seeded or constant weights, and checkpoint files."""

import zlib
from collections import OrderedDict
from pathlib import Path

import numpy as np
import torch

from helpers.seeded_weights import checkpoint_shapes, seeded_weights


def seeded_state(name):
    """A state dict of seeded weights, with the keys of a checkpoint of `checkpoint_shapes`."""
    arrays = seeded_weights(checkpoint_shapes()[name])
    return OrderedDict((key, torch.from_numpy(np.asarray(array))) for key, array in arrays.items())


def constant_state(name):
    """A small state dict: all elements of a weight are one number, computed from its key."""
    return OrderedDict(
        (key, torch.tensor(float(zlib.crc32(key.encode()) % 1000)).expand(shape))
        for key, shape in checkpoint_shapes()[name].items()
    )


def save_checkpoint(path: Path, content: object, *, zipped: bool = False) -> Path:
    """Write a file in PyTorch's zip format, or in the legacy format of the authors' files."""
    torch.save(content, path, _use_new_zipfile_serialization=zipped)
    return path
