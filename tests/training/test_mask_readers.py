"""Training sets that tell masks: DAVIS, YouTube-VOS, and pictures beside masks."""

import json

import numpy as np
import pytest

from helpers.sets_on_disk import (
    BOX,
    OTHER,
    mask_of,
    opened,
    scene,
    write_davis,
    write_image,
    write_palette_png,
)
from ssiam.datasets import DatasetError
from ssiam.errors import SourceError

PALETTE = [(0, 0, 0), (236, 95, 103), (249, 145, 87)]


class TestDavis:
    def test_boxes_masks_and_hidden_frames(self, tmp_path):
        source = opened("davis", write_davis(tmp_path, frames=3, hidden=(1,)))
        track = source.track(0)
        assert (len(source), track.frames) == (1, 3)
        assert track.box(0) == BOX
        assert track.box(1) is None
        assert track.box(2) == (BOX[0] + 8, *BOX[1:])
        assert track.mask(2).sum() == BOX[2] * BOX[3]
        assert track.image(2).shape == (240, 320, 3)

    def test_several_objects_of_a_palette_are_tracks_beside_each_other(self, tmp_path):
        for t in range(2):
            write_image(tmp_path / f"JPEGImages/480p/duo/{t:05}.jpg", scene(BOX, OTHER))
            write_palette_png(
                tmp_path / f"Annotations/480p/duo/{t:05}.png",
                mask_of(BOX, OTHER, labels=[1, 2]),
                PALETTE,
            )
        source = opened("davis", tmp_path)
        assert [source.track(i).box(1) for i in range(2)] == [BOX, OTHER]
        assert list(source.beside(0)) == [1]

    def test_videos_are_taken_and_left_out_by_name(self, tmp_path):
        for name in ("bear", "boat", "camel"):
            write_davis(tmp_path, name)
        assert len(opened("davis", tmp_path, without=("b*",))) == 1
        assert len(opened("davis", tmp_path, only=("b*",), without=("boat",))) == 1
        with pytest.raises(DatasetError, match="nothing of it is taken"):
            opened("davis", tmp_path, only=("x",))


def test_youtube_vos_tells_objects_by_the_index_of_the_palette(tmp_path):
    for t in (0, 5):
        boxes, labels = ([BOX], [1]) if t == 0 else ([BOX, OTHER], [1, 2])
        write_image(tmp_path / f"JPEGImages/abc/{t:05}.jpg", scene(*boxes))
        mask = mask_of(*boxes, labels=labels)
        write_palette_png(tmp_path / f"Annotations/abc/{t:05}.png", mask, PALETTE)
    write_image(tmp_path / "JPEGImages/abc/00001.jpg", scene())
    (tmp_path / "meta.json").write_text(json.dumps({"videos": {"abc": {"objects": {"2": {}}}}}))
    track = opened("youtube_vos", tmp_path).track(0)
    assert track.frames == 2
    assert track.box(0) is None
    assert track.box(1) == OTHER


@pytest.mark.parametrize("folders", [("images", "masks"), (".", ".")], ids=["two", "one"])
def test_pictures_with_masks(tmp_path, folders):
    write_image(tmp_path / folders[0] / "1.jpg", scene(BOX))
    write_image(tmp_path / folders[1] / "1.png", mask_of(BOX))
    track = opened("masks", tmp_path).track(0)
    assert track.box(0) == BOX


def test_a_mask_of_another_size_is_told(tmp_path):
    write_image(tmp_path / "images/1.jpg", scene(BOX))
    write_image(tmp_path / "masks/1.png", np.full((9, 9), 255, np.uint8))
    with pytest.raises(SourceError, match="has 9x9 pixels, its picture 320x240"):
        opened("masks", tmp_path).track(0).box(0)
