"""The content of pairs: labels agree with the crops, and negatives do not show the target."""

import numpy as np
import pytest

from helpers.bright_tracks import BrightTrack, TrackWithoutMask, bright_box, pair_sampler
from helpers.sets_on_disk import OTHER
from ssiam.training import AugmentSettings, CropSettings, TrackList

DUO = [  # far apart in the same frames
    BrightTrack("duo", 0, xywh=(10, 10, 20, 20), others=((1, (280, 200, 20, 20)),)),
    BrightTrack("duo", 1, xywh=(280, 200, 20, 20), others=((0, (10, 10, 20, 20)),)),
]


def test_boxes_are_on_the_target():
    source = TrackList("a", [BrightTrack(xywh=(140, 100, 40, 30))])
    batch = pair_sampler(source, negatives=0).batch(0, 40)
    assert batch.present.all()
    for search, box in zip(batch.search, batch.box, strict=True):
        inside = np.abs(box[:2]) + box[2:] / 2 < 126
        found = bright_box(search[0])
        np.testing.assert_allclose(found[:2][inside], box[:2][inside], atol=0.8)
        np.testing.assert_allclose(found[2:][inside], box[2:][inside], atol=1.3)


def test_flips_mirror_both_crops():
    augment = AugmentSettings(grey=0, flip=1, colour=0, blur=0, shake=0, jpeg=0, cover=0)
    distractors = ((1, (88, 100, 8, 20)),)
    track = BrightTrack(xywh=(100, 100, 30, 30), others=distractors)
    settings = {"augment": augment, "windows": CropSettings(shift=30, far=0, angle=0)}
    batch = pair_sampler(TrackList("a", [track]), negatives=0, **settings).batch(0, 10)
    for template in batch.template:
        columns = np.nonzero(template[1] > 135)[1]
        assert columns.mean() > 64
    np.testing.assert_allclose(bright_box(batch.search[0, 0])[:2], batch.box[0, :2], atol=0.8)


def test_rotated_targets_have_the_box_of_their_mask():
    rotated = CropSettings(shift=30, far=0, scale=0, stretch=0, angle=0, turned=1)
    source = TrackList("a", [BrightTrack(xywh=(130, 110, 60, 20))])
    batch = pair_sampler(source, windows=rotated, negatives=0).batch(0, 40)
    for search, box in zip(batch.search, batch.box, strict=True):
        np.testing.assert_allclose(bright_box(search[0]), box, atol=2)
    upright, across = np.ptp(np.log(batch.box[:, 2] / batch.box[:, 3])), np.log(3)
    assert upright > 1.5 * across


def test_targets_without_a_mask_are_not_rotated():
    rotated = CropSettings(shift=0, far=0, scale=0, stretch=0, angle=0, turned=1)
    source = TrackList("a", [TrackWithoutMask(xywh=(130, 110, 60, 20))])
    batch = pair_sampler(source, windows=rotated, negatives=0).batch(0, 20)
    np.testing.assert_allclose(batch.box[:, 2] / batch.box[:, 3], 3)
    for search, box in zip(batch.search, batch.box, strict=True):
        np.testing.assert_allclose(bright_box(search[0]), box, atol=1.3)


def test_shapes_types_and_zooms():
    batch = pair_sampler(TrackList("a", [BrightTrack()]), negatives=0).batch(3, 5)
    values = {name: value for name, value in vars(batch).items() if value is not None}
    shapes = {name: (value.shape, value.dtype.name) for name, value in values.items()}
    assert shapes == {
        "template": ((5, 3, 127, 127), "uint8"),
        "search": ((5, 3, 255, 255), "uint8"),
        "box": ((5, 4), "float32"),
        "present": ((5,), "bool"),
        "weight": ((5,), "float32"),
        "template_wh": ((5, 2), "float32"),
    }
    for template in batch.template:
        rows, columns = np.nonzero(template[0] > 135)
        assert 45 < np.sqrt(np.ptp(rows) * np.ptp(columns)) < 85


def test_targets_stay_within_the_response_map():
    wide = CropSettings(shift=112, far=1.0)
    shaken = AugmentSettings(shake=1)
    source = TrackList("a", [BrightTrack()])
    batch = pair_sampler(source, windows=wide, augment=shaken, negatives=0).batch(0, 60)
    assert np.abs(batch.box[:, :2]).max() <= 112.001
    assert np.abs(batch.box[:, :2]).max() > 90


class TestNegatives:
    @pytest.mark.parametrize("surroundings", [0, 1])
    def test_other_tracks_do_not_show_the_target(self, surroundings):
        source = TrackList("a", [BrightTrack("one", 0), BrightTrack("two", 1, xywh=OTHER)])
        settings = {"negatives": 1, "beside": 0, "away": 0, "surroundings": surroundings}
        self.check(pair_sampler(source, **settings))

    def test_sets_with_repeated_objects_use_other_sets(self):
        alike = TrackList("a", [BrightTrack("one", 0), BrightTrack("two", 0)], alike=True)
        other = TrackList("b", [BrightTrack("three", 1)], alike=True)
        self.check(pair_sampler(alike, other, negatives=1, beside=0, away=0))

    @pytest.mark.parametrize(("beside", "away"), [(1, 0), (0, 1)])
    def test_distractors_and_other_parts_do_not_show_the_target(self, beside, away):
        settings = {"negatives": 1, "beside": beside, "away": away}
        self.check(pair_sampler(TrackList("a", DUO), **settings), least=0.3)

    def test_a_single_target_that_fills_the_frame_has_none(self):
        single = TrackList("a", [BrightTrack(xywh=(20, 20, 280, 200))])
        assert pair_sampler(single, negatives=1).batch(0, 5).present.all()

    def test_their_fraction_is_the_setting(self):
        source = TrackList("a", [BrightTrack("one"), BrightTrack("two")])
        assert 0.06 < 1 - pair_sampler(source).batch(0, 300).present.mean() < 0.19

    def check(self, sampler, least=0.9):
        batch = sampler.batch(1, 40)
        assert 1 - batch.present.mean() >= least
        for template, search in zip(
            batch.template[~batch.present], batch.search[~batch.present], strict=True
        ):
            channel = int(np.argmax(template[:, 54:73, 54:73].mean(axis=(1, 2))))
            assert (search[channel] < 150).all()


def test_augmentations_do_not_move_the_target():
    everything = AugmentSettings(grey=0.5, colour=1, blur=1, shake=1, jpeg=1, cover=0)
    source = TrackList("a", [BrightTrack(channel=1, xywh=(140, 100, 40, 40))])
    batch = pair_sampler(source, augment=everything, negatives=0).batch(0, 30)
    for search, box in zip(batch.search, batch.box, strict=True):
        if (np.abs(box[:2]) + box[2:] / 2 < 120).all():
            bright = search.max(axis=0).astype(float) - np.median(search.max(axis=0))
            rows, columns = np.indices(bright.shape) - 127
            bright[bright < 40] = 0
            center = (columns * bright).sum() / bright.sum(), (rows * bright).sum() / bright.sum()
            np.testing.assert_allclose(center, box[:2], atol=2.5)


def test_recent_templates_vary_more_than_templates():
    source = TrackList("a", [BrightTrack(xywh=(130, 110, 40, 40))])
    batch = pair_sampler(source, negatives=0, recent=1).batch(0, 60)
    recent, template = (
        np.array([np.argwhere(each[0] > 135).mean(axis=0) - 63 for each in crops])
        for crops in (batch.recent, batch.template)
    )
    assert np.abs(recent).max() < 10
    assert recent.std() > 1.5 * template.std()


def test_half_of_the_batches_have_recent_templates():
    sampler = pair_sampler(TrackList("a", [BrightTrack()]), negatives=0, recent=0.5)
    without = [sampler.batch(step, 2).recent is None for step in range(40)]
    assert 10 < sum(without) < 30


def test_mistaken_recent_templates_show_a_distractor():
    source = TrackList("a", DUO)
    batch = pair_sampler(source, negatives=0, recent=1, mistaken=1).batch(0, 10)
    middle = slice(54, 73)
    for template, recent in zip(batch.template, batch.recent, strict=True):
        own = int(np.argmax(template[:, middle, middle].mean(axis=(1, 2))))
        assert recent[own, middle, middle].mean() < 60
        assert recent[1 - own, middle, middle].mean() > 135


def test_search_regions_are_shifted_towards_distractors():
    neighbors = [
        BrightTrack("duo", 0, xywh=(100, 100, 20, 20), others=((1, (130, 100, 20, 20)),)),
        BrightTrack("duo", 1, xywh=(130, 100, 20, 20), others=((0, (100, 100, 20, 20)),)),
    ]
    exact = CropSettings(shift=0, far=0, scale=0, stretch=0, angle=0)
    sampler = pair_sampler(TrackList("a", neighbors), negatives=0, towards=1, windows=exact)
    batch = sampler.batch(0, 40)
    for template, box in zip(batch.template, batch.box, strict=True):
        is_left = template[0, 63, 63] > 135
        assert (box[0] < -10) == is_left
        assert abs(box[0]) <= 100
        assert box[1] == pytest.approx(0, abs=1e-3)


def test_small_targets_are_coarse():
    augment = AugmentSettings(grey=0, flip=0, colour=0, blur=0, shake=0, jpeg=0, cover=0, small=1)
    source = TrackList("a", [BrightTrack(xywh=(140, 100, 60, 60))])
    coarse = pair_sampler(source, negatives=0, augment=augment).batch(0, 10)
    fine = pair_sampler(source, negatives=0).batch(0, 10)

    def steepest(batch):
        return np.abs(np.diff(batch.search[:, 0].astype(int), axis=2)).max()

    assert steepest(coarse) < 0.75 * steepest(fine)
