"""The deterministic weights with which the golden arrays were made.

The random numbers of a weight are seeded by its name, so only names and shapes are stored.
"""

import gzip
import json
import zlib
from functools import cache
from pathlib import Path

import numpy as np

from helpers.synthetic import generator

GOLDEN = Path(__file__).parents[1] / "golden" / "networks"

# Factors by the end of a weight's name; the first match is used. They keep activations in range.
FACTORS = {
    "backbone.conv1.weight": 1 / 64,
    "backbone.layer0.0.weight": 1 / 64,
    "backbone.features.0.weight": 1 / 64,
    "features.features.conv1.weight": 1 / 64,
    "backbone.conv1.0.weight": 1 / 64,
    ".bn3.weight": 0.25,
    "conv_kernel.1.weight": 0.2,
    "conv_kernel.1.bias": 0.2,
    "cls.head.3.weight": 0.02,
    "loc.head.3.weight": 0.002,
    "mask_head.head.3.weight": 0.02,
    "mask_model.mask.head.3.weight": 0.02,
    "post2.weight": 0.03,
}


def noise_crop(seed, side, count=1):
    """Crops of noise (count, 3, side, side), float32 in 0..255."""
    return generator(seed).integers(0, 256, (count, 3, side, side)).astype(np.float32)


@cache
def checkpoint_shapes():
    """Shapes of the weights of every checkpoint: {checkpoint: {name: shape}}."""
    lists = json.loads(gzip.decompress((GOLDEN / "keys.json.gz").read_bytes()))
    return {
        name: {key: tuple(shape) for key, shape in keys.items()} for name, keys in lists.items()
    }


def seeded_weights(shapes):
    """Arrays by name for {name: shape}."""
    return {key: _weight(key, shape) for key, shape in shapes.items()}


def _weight(key, shape):
    if key.endswith("num_batches_tracked"):
        return np.zeros(shape, np.int64)
    noise = generator(zlib.crc32(key.encode())).standard_normal(shape)
    factor = next((factor for end, factor in FACTORS.items() if key.endswith(end)), 1)
    return np.asarray(_scaled(key, noise) * factor, np.float32)


def _scaled(key, noise):
    if key.endswith(("cls_weight", "loc_weight")):
        return noise
    if key.endswith("running_var"):
        return 1 + 0.1 * np.abs(noise)
    if noise.ndim == 4:
        return noise * np.sqrt(2 / np.prod(noise.shape[1:]))
    if key.endswith(".weight"):
        return 1 + 0.1 * noise
    return 0.1 * noise
