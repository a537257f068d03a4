"""Which frames make pairs: what is passed, what it depends on, and by whom they are loaded."""

import logging

import numpy as np
import pytest

from helpers.bright_tracks import Track, sampler
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


def test_hidden_frames_are_passed():
    track = Track(frames=40, hidden=tuple(range(1, 40, 2)))
    batch = sampler(TrackList("a", [track]), negatives=0).batch(0, 40)
    assert (batch.search[:, 0] > 200).any(axis=(1, 2)).all()
    with pytest.raises(DatasetError, match="show no target; all hidden"):
        sampler(TrackList("a", [Track(frames=2, hidden=(0, 1))])).batch(0, 1)


def test_frames_are_within_reach():
    seen = []

    class Told(Track):
        def image(self, t):
            seen.append(t)
            return super().image(t)

    made = sampler(TrackList("a", [Told(frames=1000)]), reach=7, negatives=0)
    for place in range(20):
        made.pair(0, place)
    gaps = np.abs(np.diff(np.reshape(seen, (-1, 2)), axis=1))
    assert 1 < gaps.max() <= 7


def test_broken_pictures_are_told_once_and_passed(caplog):
    source = TrackList("a", [Track("good"), Track("bad", broken=True)])
    with caplog.at_level(logging.WARNING):
        assert len(sampler(source).batch(0, 20)) == 20
    assert caplog.text.count("bad.jpg: is not an image; left out") == 1
    with pytest.raises(DatasetError, match=r"show no target; bad\.jpg: is not an image"):
        sampler(TrackList("a", [Track("bad", broken=True)])).batch(0, 1)


def test_weights_choose_the_source():
    first, second = TrackList("a", [Track("one", 0)], 3.0), TrackList("b", [Track("two", 1)], 1.0)
    batch = sampler(first, second, negatives=0).batch(0, 200)
    from_first = (batch.search[:, 0] > 200).any(axis=(1, 2))
    assert 0.65 < from_first.mean() < 0.85
    with pytest.raises(ArgumentError, match="weight above 0"):
        sampler(TrackList("a", [Track()], 0.0))


def test_pairs_depend_on_seed_and_step_and_place_alone(tmp_path):
    source = open_training_source(SourceSettings("davis", str(write_davis(tmp_path))))
    made = PairSampler([source], seed=4)
    late = made.batch(7, 4)
    fresh = PairSampler([source], seed=4).batch(7, 6)
    for name, value in vars(late).items():
        if value is None:
            continue
        np.testing.assert_array_equal(value, getattr(fresh, name)[:4], err_msg=name)
    assert (PairSampler([source], seed=5).batch(7, 4).search != late.search).any()
    assert (made.batch(8, 4).search != late.search).any()


@pytest.mark.parametrize("workers", [1, 2])
def test_workers_change_nothing(tmp_path, workers):
    source = open_training_source(SourceSettings("davis", str(write_davis(tmp_path))))
    made = PairSampler([source], seed=1)
    alone = list(load_batches(made, range(3, 9), 3))
    loaded = list(load_batches(made, range(3, 9), 3, workers=workers))
    assert len(alone) == len(loaded) == 6
    for one, other in zip(alone, loaded, strict=True):
        for name, value in vars(one).items():
            np.testing.assert_array_equal(value, getattr(other, name), err_msg=name)


def test_errors_of_workers_are_told(tmp_path):
    source = open_training_source(
        SourceSettings("davis", str(write_davis(tmp_path, hidden=(1, 2))))
    )
    (tmp_path / "JPEGImages/480p/bear/00000.jpg").write_bytes(b"<html>")
    with pytest.raises(DatasetError, match=r"00000\.jpg: is not an image"):
        list(load_batches(PairSampler([source]), range(2), 2, workers=1))
