import json
import logging

import cv2
import numpy as np
import pytest
from sets_on_disk import (
    BOX,
    OTHER,
    SIZE_WH,
    mask_of,
    scene,
    write_coco,
    write_davis,
    write_image,
    write_palette_png,
    write_stamps,
    write_voc,
)

from ssiam.datasets import DatasetError
from ssiam.errors import ArgumentError, SourceError
from ssiam.training import SourceSettings, open_training_source

PALETTE = [(0, 0, 0), (236, 95, 103), (249, 145, 87)]


def opened(layout, path, **options):
    return open_training_source(SourceSettings(layout, str(path), **options))


def polygon(box):
    x, y, w, h = box
    return [x, y, x + w, y, x + w, y + h, x, y + h]


def entry(box, number=1, **more):
    return {"image_id": number, "bbox": list(box), "segmentation": [polygon(box)], **more}


def packed(counts):
    """COCO's compressed text of runs, by its own rule."""
    text = ""
    for i, count in enumerate(counts):
        value = count - (counts[i - 2] if i > 2 else 0)
        more = True
        while more:
            code = value & 0x1F
            value >>= 5
            more = value != -1 if code & 0x10 else value != 0
            text += chr(48 + code + (0x20 if more else 0))
    return text


def runs_of(mask):
    flat = mask.T.ravel() > 0
    edges = np.flatnonzero(np.diff(flat)) + 1
    counts = np.diff([0, *edges, flat.size]).tolist()
    return [0, *counts] if flat[0] else counts


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


class TestVoc:
    def test_whole_numbers_are_pixels_and_fractions_are_edges(self, tmp_path):
        pictures = {"a": [("cat", ("11", "21", "30", "60")), ("dog", ("1.5", "2", "11.5", "12"))]}
        source = opened("voc", write_voc(tmp_path, pictures, ("images", "annots")))
        assert [source.track(i).box(0) for i in range(2)] == [(10, 20, 20, 40), (1.5, 2, 10, 10)]
        assert list(source.beside(0)) == [1]

    def test_an_object_alone_is_followed_through_a_video(self, tmp_path):
        pictures = {f"{t:03}": [("cat", (10 + t, 20, 60 + t, 90))] for t in range(4)}
        pictures["004"] = [("dog", (10, 20, 60, 90))]
        pictures["005"] = [("dog", (210, 120, 260, 190))]
        source = opened("voc_video", write_voc(tmp_path, pictures))
        assert [source.track(i).frames for i in range(len(source))] == [4, 1, 1]
        assert source.track(0).box(3) == (12, 19, 51, 71)

    def test_one_damaged_file_of_many_is_left_out_with_a_warning(self, tmp_path, caplog):
        write_voc(tmp_path, {f"{i:02}": [("cat", (10, 20, 60, 90))] for i in range(20)})
        (tmp_path / "Annotations/07.xml").write_text("<annotation><object>")
        with caplog.at_level(logging.WARNING):
            assert len(opened("voc", tmp_path)) == 19
        assert "1 of 20" in caplog.text
        assert "07.xml" in caplog.text

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("<annotation><object>", "is no XML"),
            ('<!DOCTYPE a [<!ENTITY b "c">]><a/>', "entities"),
            ("<a><object><bndbox><xmin>1</xmin></bndbox></object></a>", "four numbers"),
        ],
        ids=["cut off", "entities", "no box"],
    )
    def test_a_set_of_damaged_files_is_refused(self, tmp_path, text, said):
        write_voc(tmp_path, {"a": [("cat", (10, 20, 60, 90))]})
        (tmp_path / "Annotations/a.xml").write_text(text)
        with pytest.raises(DatasetError, match=rf"a\.xml.*{said}"):
            opened("voc", tmp_path)


class TestCoco:
    def test_boxes_and_polygons(self, tmp_path):
        path = write_coco(tmp_path, [entry(BOX), entry(OTHER), entry(BOX, iscrowd=1)])
        source = opened("coco", path)
        assert len(source) == 2
        track = source.track(0)
        assert track.box(0) == BOX
        wrong = (track.mask(0) != (mask_of(BOX) > 0)).sum()
        assert wrong <= 2 * (BOX[2] + BOX[3])
        assert list(source.beside(0)) == [1]

    @pytest.mark.parametrize("compressed", [False, True], ids=["lengths", "text"])
    def test_runs(self, tmp_path, compressed):
        counts = runs_of(mask_of(BOX, OTHER))
        runs = {"size": [240, 320], "counts": packed(counts) if compressed else counts}
        track = opened("coco", write_coco(tmp_path, [{**entry(BOX), "segmentation": runs}])).track(
            0
        )
        np.testing.assert_array_equal(track.mask(0), mask_of(BOX, OTHER) > 0)

    @pytest.mark.parametrize(
        ("annotation", "said"),
        [
            (entry(BOX, number=7), "which is none"),
            (entry((1, 2, 0, 4)), "has the box"),
            ({**entry(BOX), "bbox": ["x", 1, 2, 3]}, "not numbers"),
            ({**entry(BOX), "segmentation": {"size": [9, 9], "counts": [3]}}, "runs of 3 pixels"),
            ({**entry(BOX), "segmentation": {"size": [9, 9], "counts": "~~"}}, "compressed runs"),
            ({**entry(BOX), "segmentation": [[1, 2, 3]]}, "polygon"),
            ("nothing", "lacks 'image_id'"),
        ],
    )
    def test_damaged_objects_are_told(self, tmp_path, annotation, said):
        with pytest.raises(DatasetError, match=rf"instances_train\.json.*{said}"):
            opened("coco", write_coco(tmp_path, [annotation]))

    def test_pictures_do_not_lead_out_of_their_folder(self, tmp_path):
        path = write_coco(tmp_path, [entry(BOX)])
        path.write_text(path.read_text().replace("000001.png", "../../000001.png"))
        with pytest.raises(DatasetError, match="does not lie inside"):
            opened("coco", path)


def test_yolo_boxes_and_polygons_are_shares(tmp_path):
    width, height = SIZE_WH
    x, y, w, h = BOX
    write_image(tmp_path / "images/train/1.png", scene(BOX, OTHER))
    shares = np.array(polygon(OTHER)).reshape(-1, 2) / SIZE_WH
    (tmp_path / "labels/train").mkdir(parents=True)
    (tmp_path / "labels/train/1.txt").write_text(
        f"3 {(x + w / 2) / width} {(y + h / 2) / height} {w / width} {h / height}\n"
        f"5 {' '.join(map(str, shares.ravel()))}\n"
    )
    source = opened("yolo", tmp_path)
    np.testing.assert_allclose(source.track(0).box(0), BOX)
    np.testing.assert_allclose(source.track(1).box(0), OTHER)
    assert source.track(0).mask(0) is None
    inside = source.track(1).mask(0) & (mask_of(OTHER) > 0)
    assert inside.sum() == OTHER[2] * OTHER[3]


@pytest.mark.parametrize("line", ["0 a b c d", "0 .1 .2 .3", "0 .5 .5 0 .1", "0 9 9 9 9"], ids=str)
def test_damaged_yolo_lines_are_told(tmp_path, line):
    write_image(tmp_path / "images/1.png", scene(BOX))
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels/1.txt").write_text(line)
    with pytest.raises(DatasetError, match=r"1\.txt: line 1"):
        opened("yolo", tmp_path)


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


def test_sequences_of_tracking_datasets(tmp_path):
    folder = tmp_path / "train/GOT-10k_Train_000001"
    for t in range(3):
        write_image(folder / f"{t + 1:08}.jpg", scene(BOX))
    (folder / "groundtruth.txt").write_text("1,2,30,40\n2,2,30,40\n3,2,30,40\n")
    (folder / "absence.label").write_text("0\n1\n0\n")
    track = opened("got10k", tmp_path, split="train").track(0)
    assert [track.box(t) for t in range(3)] == [(1, 2, 30, 40), None, (3, 2, 30, 40)]


def test_stamps_are_pasted_with_their_masks(tmp_path):
    write_stamps(tmp_path)
    source = opened("stamps", tmp_path / "stamps", backgrounds=(str(tmp_path / "grounds"),))
    track = source.track(1)
    first = track.image(0)
    assert track.frames == 3
    x, y, w, h = map(int, track.box(0))
    assert track.mask(0).sum() > 0.6 * w * h
    assert track.mask(0)[y : y + h, x : x + w].sum() == track.mask(0).sum()
    inner = cv2.erode(track.mask(0).astype(np.uint8), np.ones((5, 5))) > 0
    # The stamps are of one colour, which noise is not.
    assert first[inner].std(axis=0).max() < 3
    assert (track.image(1) != first).any()
    np.testing.assert_array_equal(source.track(1).image(0), first)


def test_regions_have_texture(tmp_path):
    image = np.full((240, 320, 3), 90, np.uint8)
    image[60:180, 160:280] = scene(seed=5)[60:180, 160:280] * 4
    write_image(tmp_path / "half.png", image)
    source = opened("regions", tmp_path)
    boxes = [source.track(i).box(0) for i in range(len(source))]
    found = [box for box in boxes if box is not None]
    assert found
    for x, y, w, h in found:
        assert image[int(y) : int(y + h), int(x) : int(x + w)].std() > 10


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"layout": "imagenet"}, "unknown layout"),
        ({"layout": "voc", "weight": -1}, "weight -1"),
        ({"layout": "stamps"}, "need backgrounds"),
    ],
)
def test_wrong_settings_are_told(options, said):
    with pytest.raises(ArgumentError, match=said):
        SourceSettings(**{"path": "somewhere", **options})


@pytest.mark.parametrize("layout", ["voc", "yolo", "davis", "youtube_vos", "masks", "regions"])
def test_an_empty_folder_is_told(tmp_path, layout):
    with pytest.raises(DatasetError, match=str(tmp_path)):
        opened(layout, tmp_path)
