"""The patches of search features for SiamMask's refinement."""

import numpy as np
import pytest

from ssiam.trackers.siammask import refinement_windows

SHAPES = ((1, 256, 25, 25), (1, 64, 125, 125), (1, 256, 63, 63), (1, 512, 31, 31))


@pytest.mark.parametrize("cell", [(0, 0), (24, 24), (3, 21), (12, 12)])
def test_patches_equal_those_of_padded_features(cell):
    random = np.random.default_rng(0)
    corr, x0, p1, p2 = (random.random(shape, dtype=np.float32) for shape in SHAPES)
    patches = refinement_windows(corr, [x0, p1, p2], cell)
    layout = ((x0, 16, 4, 61), (p1, 8, 2, 31), (p2, 4, 1, 15), (corr, 0, 1, 1))
    for patch, (features, pad, stride, side) in zip(patches, layout, strict=True):
        padded = np.pad(features, ((0, 0), (0, 0), (pad, pad), (pad, pad)))
        rows, columns = (slice(stride * i, stride * i + side) for i in cell)
        assert np.array_equal(patch, padded[:, :, rows, columns])
        assert patch.dtype == np.float32
