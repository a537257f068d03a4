"""MOTChallenge in training: the objects of a clip are beside each other in the same frames."""

import logging

import numpy as np
import pytest

from helpers.datasets_on_disk import write_mot
from helpers.sets_on_disk import opened
from ssiam.datasets import DatasetError
from ssiam.training import LAYOUTS

# frame, id, x, y, w, h, flag, class, visibility
WALKERS = [
    (1, 1, 11, 21, 30, 60, 1, 1, 1),
    (3, 1, 15, 21, 30, 60, 1, 1, 0.2),
    (4, 1, 17, 21, 30, 60, 1, 1, 0.6),
    (2, 2, 61, 21, 30, 60, 1, 1, 1),
    (2, 3, 61, 21, 30, 60, 0, 1, 1),
]


def test_objects_share_all_frames_and_are_beside_each_other(tmp_path):
    write_mot(tmp_path / "train", "street", WALKERS)
    write_mot(tmp_path / "train", "hall", WALKERS)
    source = opened("mot", tmp_path)
    assert len(source) == 4
    one, two = source.track(2), source.track(3)
    assert one.frames == two.frames == 4
    assert [one.box(t) for t in range(4)] == [(10, 20, 30, 60), None, None, (16, 20, 30, 60)]
    assert [two.box(t) for t in range(4)] == [None, (60, 20, 30, 60), None, None]
    assert list(source.beside(2)) == [3]
    assert one.shows == two.shows != source.track(0).shows
    np.testing.assert_array_equal(one.image(1), two.image(1))
    assert one.mask(0) is None


def test_names_are_those_of_the_clips(tmp_path):
    for name in ("street", "hall"):
        write_mot(tmp_path, name, WALKERS)
    assert len(opened("mot", tmp_path, only=("st*",))) == 2
    assert len(opened("mot", tmp_path / "hall")) == 2
    with pytest.raises(DatasetError, match="nothing of it is taken"):
        opened("mot", tmp_path, without=("*",))


def test_one_damaged_clip_of_many_is_left_out_with_a_warning(tmp_path, caplog):
    for number in range(20):
        folder = write_mot(tmp_path, f"clip{number}", WALKERS)
    (folder / "img1" / "000004.jpg").unlink()
    with caplog.at_level(logging.WARNING):
        assert len(opened("mot", tmp_path)) == 38
    assert "1 of 20" in caplog.text
    assert "3 images, but boxes up to frame 4" in caplog.text


def test_no_clip_is_refused(tmp_path):
    with pytest.raises(DatasetError, match=r"expected gt/gt\.txt and img1/"):
        opened("mot", tmp_path)


def test_layouts_have_every_name_once():
    assert len(set(LAYOUTS)) == len(LAYOUTS)


def test_a_shared_clip(shared):
    source = opened("mot", shared("data/mot/ADL-Rundle-6"))
    assert len(source) > 10
    assert len(source.beside(0)) == len(source) - 1
    rivals = [source.track(j).box(0) for j in source.beside(0)]
    assert sum(box is not None for box in rivals) >= 3
