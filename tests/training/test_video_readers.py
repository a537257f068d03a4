"""Annotated videos: DAVIS, YouTube-VOS, MOTChallenge, and tracking datasets."""

import json
import logging

import numpy as np
import pytest

from helpers.datasets_on_disk import write_mot
from helpers.sets_on_disk import (
    BOX,
    OTHER,
    mask_of,
    open_set,
    scene,
    write_davis,
    write_image,
    write_palette_png,
)
from ssiam.datasets import DatasetError
from ssiam.training.data import images

PALETTE = [(0, 0, 0), (236, 95, 103), (249, 145, 87)]

# frame, id, x, y, w, h, flag, class, visibility
WALKERS = [
    (1, 1, 11, 21, 30, 60, 1, 1, 1),
    (3, 1, 15, 21, 30, 60, 1, 1, 0.2),
    (4, 1, 17, 21, 30, 60, 1, 1, 0.6),
    (2, 2, 61, 21, 30, 60, 1, 1, 1),
    (2, 3, 61, 21, 30, 60, 0, 1, 1),
]


class TestDavis:
    def test_boxes_masks_and_hidden_frames(self, tmp_path):
        source = open_set("davis", write_davis(tmp_path, frames=3, hidden=(1,)))
        track = source.track(0)
        assert (len(source), track.frames) == (1, 3)
        assert track.box(0) == BOX
        assert track.box(1) is None
        assert track.box(2) == (BOX[0] + 8, *BOX[1:])
        assert track.mask(2).sum() == BOX[2] * BOX[3]
        assert track.image(2).shape == (240, 320, 3)

    def test_objects_of_a_palette_are_distractors_of_each_other(self, tmp_path):
        for t in range(2):
            write_image(tmp_path / f"JPEGImages/480p/duo/{t:05}.jpg", scene(BOX, OTHER))
            write_palette_png(
                tmp_path / f"Annotations/480p/duo/{t:05}.png",
                mask_of(BOX, OTHER, labels=[1, 2]),
                PALETTE,
            )
        source = open_set("davis", tmp_path)
        assert [source.track(i).box(1) for i in range(2)] == [BOX, OTHER]
        assert list(source.distractors(0)) == [1]

    def test_videos_are_included_and_excluded_by_name(self, tmp_path):
        for name in ("bear", "boat", "camel"):
            write_davis(tmp_path, name)
        assert len(open_set("davis", tmp_path, without=("b*",))) == 1
        assert len(open_set("davis", tmp_path, only=("b*",), without=("boat",))) == 1
        with pytest.raises(DatasetError, match="nothing is included"):
            open_set("davis", tmp_path, only=("x",))


def test_youtube_vos_labels_are_palette_indices(tmp_path):
    for t in (0, 5):
        boxes, labels = ([BOX], [1]) if t == 0 else ([BOX, OTHER], [1, 2])
        write_image(tmp_path / f"JPEGImages/abc/{t:05}.jpg", scene(*boxes))
        mask = mask_of(*boxes, labels=labels)
        write_palette_png(tmp_path / f"Annotations/abc/{t:05}.png", mask, PALETTE)
    write_image(tmp_path / "JPEGImages/abc/00001.jpg", scene())
    (tmp_path / "meta.json").write_text(json.dumps({"videos": {"abc": {"objects": {"2": {}}}}}))
    track = open_set("youtube_vos", tmp_path).track(0)
    assert track.frames == 2
    assert track.box(0) is None
    assert track.box(1) == OTHER


class TestMot:
    def test_objects_share_all_frames_of_a_clip(self, tmp_path):
        write_mot(tmp_path / "train", "street", WALKERS)
        write_mot(tmp_path / "train", "hall", WALKERS)
        source = open_set("mot", tmp_path)
        assert len(source) == 4
        one, two = source.track(2), source.track(3)
        assert one.frames == two.frames == 4
        assert [one.box(t) for t in range(4)] == [(10, 20, 30, 60), None, None, (16, 20, 30, 60)]
        assert [two.box(t) for t in range(4)] == [None, (60, 20, 30, 60), None, None]
        assert list(source.distractors(2)) == [3]
        assert one.scene_ids == two.scene_ids != source.track(0).scene_ids
        np.testing.assert_array_equal(one.image(1), two.image(1))
        assert one.mask(0) is None

    def test_patterns_match_the_names_of_clips(self, tmp_path):
        for name in ("street", "hall"):
            write_mot(tmp_path, name, WALKERS)
        assert len(open_set("mot", tmp_path, only=("st*",))) == 2
        assert len(open_set("mot", tmp_path / "hall")) == 2
        with pytest.raises(DatasetError, match="nothing is included"):
            open_set("mot", tmp_path, without=("*",))

    def test_one_damaged_clip_of_many_is_skipped_with_a_warning(self, tmp_path, caplog):
        for number in range(20):
            folder = write_mot(tmp_path, f"clip{number}", WALKERS)
        (folder / "img1" / "000004.jpg").unlink()
        with caplog.at_level(logging.WARNING):
            assert len(open_set("mot", tmp_path)) == 38
        assert "1 of 20" in caplog.text
        assert "3 images, but boxes up to frame 4" in caplog.text

    def test_a_folder_without_clips_is_rejected(self, tmp_path):
        with pytest.raises(DatasetError, match=r"expected gt/gt\.txt and img1/"):
            open_set("mot", tmp_path)

    def test_a_shared_clip(self, shared):
        source = open_set("mot", shared("data/mot/ADL-Rundle-6"))
        assert len(source) > 10
        assert len(source.distractors(0)) == len(source) - 1
        boxes = [source.track(j).box(0) for j in source.distractors(0)]
        assert sum(box is not None for box in boxes) >= 3


def test_sequences_of_tracking_datasets(tmp_path):
    folder = tmp_path / "train/GOT-10k_Train_000001"
    for t in range(3):
        write_image(folder / f"{t + 1:08}.jpg", scene(BOX))
    (folder / "groundtruth.txt").write_text("1,2,30,40\n2,2,30,40\n3,2,30,40\n")
    (folder / "absence.label").write_text("0\n1\n0\n")
    track = open_set("got10k", tmp_path, split="train").track(0)
    assert [track.box(t) for t in range(3)] == [(1, 2, 30, 40), None, (3, 2, 30, 40)]


def test_boxes_of_labels_are_found_once(tmp_path, monkeypatch):
    track = open_set("davis", write_davis(tmp_path, frames=6)).track(0)
    boxes = [track.box(t) for t in range(6)]
    monkeypatch.setattr(images, "read_unchanged", None)
    assert [track.box(t) for t in range(6)] == boxes
