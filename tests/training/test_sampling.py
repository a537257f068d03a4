"""Which frames become pairs, on what they depend, and loading in worker processes."""

import logging

import numpy as np
import pytest

from helpers.bright_tracks import BrightTrack, pair_sampler
from helpers.sets_on_disk import write_davis
from ssiam.datasets import DatasetError
from ssiam.errors import ArgumentError
from ssiam.training import (
    PairSampler,
    SourceSettings,
    TrackList,
    load_batches,
    open_training_source,
)


def open_davis(root, **options):
    return open_training_source(SourceSettings("davis", str(write_davis(root, **options))))


def test_hidden_frames_are_skipped():
    track = BrightTrack(frames=40, hidden=tuple(range(1, 40, 2)))
    batch = pair_sampler(TrackList("a", [track]), negatives=0).batch(0, 40)
    assert (batch.search[:, 0] > 200).any(axis=(1, 2)).all()
    hidden = TrackList("a", [BrightTrack(frames=2, hidden=(0, 1))])
    with pytest.raises(DatasetError, match="show no target; all are hidden"):
        pair_sampler(hidden).batch(0, 1)


def test_frames_of_a_pair_are_within_reach():
    requested = []

    class RecordingTrack(BrightTrack):
        def image(self, t):
            requested.append(t)
            return super().image(t)

    sampler = pair_sampler(TrackList("a", [RecordingTrack(frames=1000)]), reach=7, negatives=0)
    for index in range(20):
        sampler.pair(0, index)
    gaps = np.abs(np.diff(np.reshape(requested, (-1, 2)), axis=1))
    assert 1 < gaps.max() <= 7


def test_damaged_images_are_skipped_with_one_warning(caplog):
    damaged = BrightTrack("bad", damaged=True)
    source = TrackList("a", [BrightTrack("good"), damaged])
    with caplog.at_level(logging.WARNING):
        assert len(pair_sampler(source).batch(0, 20)) == 20
    assert caplog.text.count("bad.jpg: is not an image; left out") == 1
    with pytest.raises(DatasetError, match=r"show no target; bad\.jpg: is not an image"):
        pair_sampler(TrackList("a", [damaged])).batch(0, 1)


def test_sources_are_drawn_by_weight():
    first = TrackList("a", [BrightTrack("one", 0)], 3.0)
    second = TrackList("b", [BrightTrack("two", 1)], 1.0)
    batch = pair_sampler(first, second, negatives=0).batch(0, 200)
    from_first = (batch.search[:, 0] > 200).any(axis=(1, 2))
    assert 0.65 < from_first.mean() < 0.85
    with pytest.raises(ArgumentError, match="weight above 0"):
        pair_sampler(TrackList("a", [BrightTrack()], 0.0))


def test_pairs_depend_on_seed_step_and_index_only(tmp_path):
    source = open_davis(tmp_path)
    sampler = PairSampler([source], seed=4)
    late = sampler.batch(7, 4)
    fresh = PairSampler([source], seed=4).batch(7, 6)
    for name, value in vars(late).items():
        if value is None:
            continue
        np.testing.assert_array_equal(value, getattr(fresh, name)[:4], err_msg=name)
    assert (PairSampler([source], seed=5).batch(7, 4).search != late.search).any()
    assert (sampler.batch(8, 4).search != late.search).any()


@pytest.mark.parametrize("workers", [1, 2])
def test_batches_do_not_depend_on_workers(tmp_path, workers):
    sampler = PairSampler([open_davis(tmp_path)], seed=1)
    alone = list(load_batches(sampler, range(3, 9), 3))
    loaded = list(load_batches(sampler, range(3, 9), 3, workers=workers))
    assert len(alone) == len(loaded) == 6
    for one, other in zip(alone, loaded, strict=True):
        for name, value in vars(one).items():
            np.testing.assert_array_equal(value, getattr(other, name), err_msg=name)


def test_errors_of_workers_are_raised(tmp_path):
    source = open_davis(tmp_path, hidden=(1, 2))
    (tmp_path / "JPEGImages/480p/bear/00000.jpg").write_bytes(b"<html>")
    with pytest.raises(DatasetError, match=r"00000\.jpg: is not an image"):
        list(load_batches(PairSampler([source]), range(2), 2, workers=1))
