"""Crops for masks: the target fills the middle, whatever its shape and rotation."""

import numpy as np
import pytest

from helpers.bright_tracks import NO_AUGMENTATION, BrightTrack, TrackWithoutMask
from ssiam.datasets import DatasetError
from ssiam.training import CropSettings, PairSettings, TrackList

pytest.importorskip("torch")

from ssiam.training.data.mask_sampling import MaskSampler


def mask_sampler(track, rotated=0.0, seed=0):
    settings = PairSettings(augment=NO_AUGMENTATION, windows=CropSettings(turned=rotated))
    return MaskSampler([TrackList("a", [track])], settings, seed)


@pytest.mark.parametrize("xywh", [(140, 100, 40, 30), (100, 60, 20, 120), (60, 100, 150, 25)])
@pytest.mark.parametrize("rotated", [0, 1])
def test_masks_are_on_the_target_and_fill_the_middle(xywh, rotated):
    batch = mask_sampler(BrightTrack(xywh=xywh), rotated).batch(0, 30)
    assert batch.crop.shape == (30, 3, 128, 128)
    assert batch.mask.shape == (30, 64, 64)
    for crop, mask in zip(batch.crop, batch.mask, strict=True):
        cells = crop[0].reshape(64, 2, 64, 2).mean(axis=(1, 3))
        assert ((cells > 135) == (mask > 127)).mean() > 0.97
        rows, columns = np.nonzero(mask > 127)
        for along in (rows, columns):
            assert 0.38 * 64 < np.ptp(along) + 1 < 0.88 * 64
            assert abs(along.min() + along.max() + 1 - 64) / 2 < 9


def test_the_same_seed_gives_the_same_crops():
    first, again, other = (mask_sampler(BrightTrack(), seed=seed).batch(3, 4) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.crop, again.crop)
    assert (first.crop != other.crop).any()


def test_targets_without_a_mask_are_skipped():
    with pytest.raises(DatasetError, match="no target with a mask"):
        mask_sampler(TrackWithoutMask()).batch(0, 1)
