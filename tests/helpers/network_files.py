"""Checkpoint files as the authors and their users have them."""

import zlib
from collections import OrderedDict
from pathlib import Path

import numpy as np
import torch

from helpers.seeded_weights import key_lists, rule_weights


def rule_state(keys):
    """A state dict of weights by rule, of the names that `key_lists` has under `keys`."""
    arrays = rule_weights(key_lists()[keys])
    return OrderedDict((key, torch.from_numpy(np.asarray(array))) for key, array in arrays.items())


def flat_state(keys):
    """A state dict that takes no room: each weight is one number, told from its name, repeated."""
    return OrderedDict(
        (key, torch.tensor(float(zlib.crc32(key.encode()) % 1000)).expand(shape))
        for key, shape in key_lists()[keys].items()
    )


def saved(path: Path, content: object, *, zipped: bool = False) -> Path:
    """The file, in PyTorch's zip format or in the one before it, which the authors' have."""
    torch.save(content, path, _use_new_zipfile_serialization=zipped)
    return path
