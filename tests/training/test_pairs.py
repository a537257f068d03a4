"""What pairs show: targets where they are told to be, and negatives without one."""

import numpy as np
import pytest

from helpers.bright_tracks import Track, box_of, sampler
from helpers.sets_on_disk import OTHER
from ssiam.training import AugmentSettings, TrackList, WindowSettings


class Boxed(Track):
    def mask(self, t):
        return None


def test_boxes_and_masks_lie_on_the_target():
    batch = sampler(TrackList("a", [Track(at=(140, 100, 40, 30))]), negatives=0).batch(0, 40)
    assert batch.present.all()
    assert batch.masked.all()
    for search, box, mask in zip(batch.search, batch.box, batch.mask, strict=True):
        inside = np.abs(box[:2]) + box[2:] / 2 < 126
        found = box_of(search[0])
        np.testing.assert_allclose(found[:2][inside], box[:2][inside], atol=0.8)
        np.testing.assert_allclose(found[2:][inside], box[2:][inside], atol=1.3)
        bright = search[0, 2::4, 2::4] > 135
        assert (bright == (mask[: len(bright), : len(bright)] >= 128)).mean() > 0.97


def test_flips_turn_both_crops():
    augment = AugmentSettings(grey=0, flip=1, colour=0, blur=0, shake=0, jpeg=0, cover=0)
    rival = ((1, (88, 100, 8, 20)),)
    track = Track(at=(100, 100, 30, 30), others=rival)
    settings = {"augment": augment, "windows": WindowSettings(shift=30, far=0, angle=0)}
    batch = sampler(TrackList("a", [track]), negatives=0, **settings).batch(0, 10)
    for template in batch.template:
        columns = np.nonzero(template[1] > 135)[1]
        assert columns.mean() > 64
    np.testing.assert_allclose(box_of(batch.search[0, 0])[:2], batch.box[0, :2], atol=0.8)


def test_turned_targets_have_the_box_of_their_mask():
    turned = WindowSettings(shift=30, far=0, scale=0, stretch=0, angle=0, turned=1)
    source = TrackList("a", [Track(at=(130, 110, 60, 20))])
    batch = sampler(source, windows=turned, negatives=0).batch(0, 40)
    for search, box in zip(batch.search, batch.box, strict=True):
        np.testing.assert_allclose(box_of(search[0]), box, atol=2)
    upright, across = np.ptp(np.log(batch.box[:, 2] / batch.box[:, 3])), np.log(3)
    assert upright > 1.5 * across


def test_targets_without_a_mask_are_not_turned():
    turned = WindowSettings(shift=0, far=0, scale=0, stretch=0, angle=0, turned=1)
    source = TrackList("a", [Boxed(at=(130, 110, 60, 20))])
    batch = sampler(source, windows=turned, negatives=0).batch(0, 20)
    np.testing.assert_allclose(batch.box[:, 2] / batch.box[:, 3], 3)
    for search, box in zip(batch.search, batch.box, strict=True):
        np.testing.assert_allclose(box_of(search[0]), box, atol=1.3)


def test_shapes_types_and_zooms():
    batch = sampler(TrackList("a", [Track()]), negatives=0).batch(3, 5)
    values = {name: value for name, value in vars(batch).items() if value is not None}
    shapes = {name: (value.shape, value.dtype.name) for name, value in values.items()}
    assert shapes == {
        "template": ((5, 3, 127, 127), "uint8"),
        "search": ((5, 3, 255, 255), "uint8"),
        "box": ((5, 4), "float32"),
        "present": ((5,), "bool"),
        "mask": ((5, 64, 64), "uint8"),
        "masked": ((5,), "bool"),
        "weight": ((5,), "float32"),
        "template_wh": ((5, 2), "float32"),
    }
    for template in batch.template:
        rows, columns = np.nonzero(template[0] > 135)
        assert 45 < np.sqrt(np.ptp(rows) * np.ptp(columns)) < 85


def test_targets_stay_in_reach_of_the_response_map():
    wide = WindowSettings(shift=112, far=1.0)
    shaken = AugmentSettings(shake=1)
    source = TrackList("a", [Track()])
    batch = sampler(source, windows=wide, augment=shaken, negatives=0).batch(0, 60)
    assert np.abs(batch.box[:, :2]).max() <= 112.001
    assert np.abs(batch.box[:, :2]).max() > 90


class TestNegatives:
    @pytest.mark.parametrize("surroundings", [0, 1])
    def test_other_tracks_do_not_show_the_target(self, surroundings):
        first = TrackList("a", [Track("one", 0), Track("two", 1, at=OTHER)])
        settings = {"negatives": 1, "beside": 0, "away": 0, "surroundings": surroundings}
        self.check(sampler(first, **settings))

    def test_sets_of_look_alikes_take_them_elsewhere(self):
        alike = TrackList("a", [Track("one", 0), Track("two", 0)], alike=True)
        other = TrackList("b", [Track("three", 1)], alike=True)
        self.check(sampler(alike, other, negatives=1, beside=0, away=0))

    def test_rivals_and_other_places_do_not_show_it(self):
        pair = [
            Track("duo", 0, at=(10, 10, 20, 20), others=((1, (280, 200, 20, 20)),)),
            Track("duo", 1, at=(280, 200, 20, 20), others=((0, (10, 10, 20, 20)),)),
        ]
        self.check(sampler(TrackList("a", pair), negatives=1, beside=1, away=0), least=0.3)
        self.check(sampler(TrackList("a", pair), negatives=1, beside=0, away=1), least=0.3)

    def test_a_lonely_target_has_none(self):
        lonely = TrackList("a", [Track(at=(20, 20, 280, 200))])
        assert sampler(lonely, negatives=1).batch(0, 5).present.all()

    def test_there_are_as_many_as_asked_for(self):
        source = TrackList("a", [Track("one"), Track("two")])
        assert 0.06 < 1 - sampler(source).batch(0, 300).present.mean() < 0.19

    def check(self, made, least=0.9):
        batch = made.batch(1, 40)
        assert 1 - batch.present.mean() >= least
        assert not batch.mask[~batch.present].any()
        assert batch.masked.all()
        for template, search in zip(
            batch.template[~batch.present], batch.search[~batch.present], strict=True
        ):
            channel = int(np.argmax(template[:, 54:73, 54:73].mean(axis=(1, 2))))
            assert (search[channel] < 150).all()


def test_augmentations_leave_the_target_where_it_is():
    everything = AugmentSettings(grey=0.5, colour=1, blur=1, shake=1, jpeg=1, cover=0)
    source = TrackList("a", [Track(channel=1, at=(140, 100, 40, 40))])
    batch = sampler(source, augment=everything, negatives=0).batch(0, 30)
    for search, box in zip(batch.search, batch.box, strict=True):
        if (np.abs(box[:2]) + box[2:] / 2 < 120).all():
            bright = search.max(axis=0).astype(float) - np.median(search.max(axis=0))
            rows, columns = np.indices(bright.shape) - 127
            bright[bright < 40] = 0
            centre = (columns * bright).sum() / bright.sum(), (rows * bright).sum() / bright.sum()
            np.testing.assert_allclose(centre, box[:2], atol=2.5)


def test_recent_templates_show_the_target_less_exactly():
    made = sampler(TrackList("a", [Track(at=(130, 110, 40, 40))]), negatives=0, recent=1)
    batch = made.batch(0, 60)
    off = np.array([np.argwhere(each[0] > 135).mean(axis=0) - 63 for each in batch.recent])
    assert np.abs(off).max() < 10
    exact = np.array([np.argwhere(each[0] > 135).mean(axis=0) - 63 for each in batch.template])
    assert off.std() > 1.5 * exact.std()


def test_half_of_the_batches_have_recent_templates():
    made = sampler(TrackList("a", [Track()]), negatives=0, recent=0.5)
    without = [made.batch(step, 2).recent is None for step in range(40)]
    assert 10 < sum(without) < 30


def test_mistaken_recent_templates_show_a_distractor():
    pair = [
        Track("duo", 0, at=(10, 10, 20, 20), others=((1, (280, 200, 20, 20)),)),
        Track("duo", 1, at=(280, 200, 20, 20), others=((0, (10, 10, 20, 20)),)),
    ]
    batch = sampler(TrackList("a", pair), negatives=0, recent=1, mistaken=1).batch(0, 10)
    middle = slice(54, 73)
    for template, recent in zip(batch.template, batch.recent, strict=True):
        own = int(np.argmax(template[:, middle, middle].mean(axis=(1, 2))))
        assert recent[own, middle, middle].mean() < 60
        assert recent[1 - own, middle, middle].mean() > 135


def test_windows_are_shifted_towards_distractors():
    pair = [
        Track("duo", 0, at=(100, 100, 20, 20), others=((1, (130, 100, 20, 20)),)),
        Track("duo", 1, at=(130, 100, 20, 20), others=((0, (100, 100, 20, 20)),)),
    ]
    source = TrackList("a", pair)
    still = WindowSettings(shift=0, far=0, scale=0, stretch=0, angle=0)
    batch = sampler(source, negatives=0, towards=1, windows=still).batch(0, 40)
    for template, box in zip(batch.template, batch.box, strict=True):
        is_left = template[0, 63, 63] > 135
        assert (box[0] < -10) == is_left
        assert abs(box[0]) <= 100
        assert box[1] == pytest.approx(0, abs=1e-3)


def test_small_targets_are_coarse():
    augment = AugmentSettings(grey=0, flip=0, colour=0, blur=0, shake=0, jpeg=0, cover=0, small=1)
    source = TrackList("a", [Track(at=(140, 100, 60, 60))])
    coarse = sampler(source, negatives=0, augment=augment).batch(0, 10)
    fine = sampler(source, negatives=0).batch(0, 10)

    def steepest(batch):
        return np.abs(np.diff(batch.search[:, 0].astype(int), axis=2)).max()

    assert steepest(coarse) < 0.75 * steepest(fine)
