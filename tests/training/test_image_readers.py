"""Annotated images: VOC, COCO, YOLO, and images with mask files."""

import logging

import numpy as np
import pytest

from helpers.sets_on_disk import (
    BOX,
    OTHER,
    SIZE_WH,
    mask_of,
    open_set,
    scene,
    write_coco,
    write_image,
    write_voc,
)
from ssiam.datasets import DatasetError
from ssiam.errors import SourceError


def polygon(box):
    x, y, w, h = box
    return [x, y, x + w, y, x + w, y + h, x, y + h]


def coco_object(box, image_id=1, **more):
    return {"image_id": image_id, "bbox": list(box), "segmentation": [polygon(box)], **more}


def compressed(counts):
    """Run lengths as COCO's text."""
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


def run_lengths(mask):
    flat = mask.T.ravel() > 0
    edges = np.flatnonzero(np.diff(flat)) + 1
    counts = np.diff([0, *edges, flat.size]).tolist()
    return [0, *counts] if flat[0] else counts


class TestVoc:
    def test_integers_are_pixels_and_fractions_are_edges(self, tmp_path):
        objects = [("cat", ("11", "21", "30", "60")), ("dog", ("1.5", "2", "11.5", "12"))]
        source = open_set("voc", write_voc(tmp_path, {"a": objects}, ("images", "annots")))
        assert [source.track(i).box(0) for i in range(2)] == [(10, 20, 20, 40), (1.5, 2, 10, 10)]
        assert list(source.distractors(0)) == [1]

    def test_single_objects_are_linked_to_tracks(self, tmp_path):
        objects = {f"{t:03}": [("cat", (10 + t, 20, 60 + t, 90))] for t in range(4)}
        objects["004"] = [("dog", (10, 20, 60, 90))]
        objects["005"] = [("dog", (210, 120, 260, 190))]
        source = open_set("voc_video", write_voc(tmp_path, objects))
        assert [source.track(i).frames for i in range(len(source))] == [4, 1, 1]
        assert source.track(0).box(3) == (12, 19, 51, 71)

    def test_one_damaged_file_of_many_is_skipped_with_a_warning(self, tmp_path, caplog):
        write_voc(tmp_path, {f"{i:02}": [("cat", (10, 20, 60, 90))] for i in range(20)})
        (tmp_path / "Annotations/07.xml").write_text("<annotation><object>")
        with caplog.at_level(logging.WARNING):
            assert len(open_set("voc", tmp_path)) == 19
        assert "1 of 20" in caplog.text
        assert "07.xml" in caplog.text

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("<annotation><object>", "is not valid XML"),
            ('<!DOCTYPE a [<!ENTITY b "c">]><a/>', "entities"),
            ("<a><object><bndbox><xmin>1</xmin></bndbox></object></a>", "four numbers"),
        ],
        ids=["truncated", "entities", "no box"],
    )
    def test_a_set_of_damaged_files_is_rejected(self, tmp_path, text, message):
        write_voc(tmp_path, {"a": [("cat", (10, 20, 60, 90))]})
        (tmp_path / "Annotations/a.xml").write_text(text)
        with pytest.raises(DatasetError, match=rf"a\.xml.*{message}"):
            open_set("voc", tmp_path)


class TestCoco:
    def test_boxes_and_polygons(self, tmp_path):
        objects = [coco_object(BOX), coco_object(OTHER), coco_object(BOX, iscrowd=1)]
        source = open_set("coco", write_coco(tmp_path, objects))
        assert len(source) == 2
        track = source.track(0)
        assert track.box(0) == BOX
        wrong = (track.mask(0) != (mask_of(BOX) > 0)).sum()
        assert wrong <= 2 * (BOX[2] + BOX[3])
        assert list(source.distractors(0)) == [1]

    @pytest.mark.parametrize("as_text", [False, True], ids=["list", "text"])
    def test_run_lengths(self, tmp_path, as_text):
        counts = run_lengths(mask_of(BOX, OTHER))
        segmentation = {"size": [240, 320], "counts": compressed(counts) if as_text else counts}
        path = write_coco(tmp_path, [{**coco_object(BOX), "segmentation": segmentation}])
        track = open_set("coco", path).track(0)
        np.testing.assert_array_equal(track.mask(0), mask_of(BOX, OTHER) > 0)

    @pytest.mark.parametrize(
        ("annotation", "message"),
        [
            (coco_object(BOX, image_id=7), "image_id 7, which no image has"),
            (coco_object((1, 2, 0, 4)), "has the box"),
            ({**coco_object(BOX), "bbox": ["x", 1, 2, 3]}, "not numbers"),
            (
                {**coco_object(BOX), "segmentation": {"size": [9, 9], "counts": [3]}},
                "run lengths of 3 pixels",
            ),
            (
                {**coco_object(BOX), "segmentation": {"size": [9, 9], "counts": "~~"}},
                "compressed run lengths",
            ),
            ({**coco_object(BOX), "segmentation": [[1, 2, 3]]}, "polygon"),
            ("nothing", "lacks 'image_id'"),
        ],
    )
    def test_damaged_objects_are_reported(self, tmp_path, annotation, message):
        with pytest.raises(DatasetError, match=rf"instances_train\.json.*{message}"):
            open_set("coco", write_coco(tmp_path, [annotation]))

    def test_images_outside_their_folder_are_rejected(self, tmp_path):
        path = write_coco(tmp_path, [coco_object(BOX)])
        path.write_text(path.read_text().replace("000001.png", "../../000001.png"))
        with pytest.raises(DatasetError, match=r"000001\.png.* inside of"):
            open_set("coco", path)


def test_yolo_boxes_and_polygons_are_fractions(tmp_path):
    width, height = SIZE_WH
    x, y, w, h = BOX
    write_image(tmp_path / "images/train/1.png", scene(BOX, OTHER))
    fractions = np.array(polygon(OTHER)).reshape(-1, 2) / SIZE_WH
    (tmp_path / "labels/train").mkdir(parents=True)
    (tmp_path / "labels/train/1.txt").write_text(
        f"3 {(x + w / 2) / width} {(y + h / 2) / height} {w / width} {h / height}\n"
        f"5 {' '.join(map(str, fractions.ravel()))}\n"
    )
    source = open_set("yolo", tmp_path)
    np.testing.assert_allclose(source.track(0).box(0), BOX)
    np.testing.assert_allclose(source.track(1).box(0), OTHER)
    assert source.track(0).mask(0) is None
    inside = source.track(1).mask(0) & (mask_of(OTHER) > 0)
    assert inside.sum() == OTHER[2] * OTHER[3]


@pytest.mark.parametrize("line", ["0 a b c d", "0 .1 .2 .3", "0 .5 .5 0 .1", "0 9 9 9 9"], ids=str)
def test_damaged_yolo_lines_are_reported(tmp_path, line):
    write_image(tmp_path / "images/1.png", scene(BOX))
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels/1.txt").write_text(line)
    with pytest.raises(DatasetError, match=r"1\.txt: line 1"):
        open_set("yolo", tmp_path)


@pytest.mark.parametrize("folders", [("images", "masks"), (".", ".")], ids=["two", "one"])
def test_images_with_mask_files(tmp_path, folders):
    write_image(tmp_path / folders[0] / "1.jpg", scene(BOX))
    write_image(tmp_path / folders[1] / "1.png", mask_of(BOX))
    track = open_set("masks", tmp_path).track(0)
    assert track.box(0) == BOX


def test_a_mask_of_another_size_is_rejected(tmp_path):
    write_image(tmp_path / "images/1.jpg", scene(BOX))
    write_image(tmp_path / "masks/1.png", np.full((9, 9), 255, np.uint8))
    with pytest.raises(SourceError, match="has 9x9 pixels, its image 320x240"):
        open_set("masks", tmp_path).track(0).box(0)
