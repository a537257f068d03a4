"""Training sets that tell boxes, polygons or runs: VOC, COCO and YOLO."""

import logging

import numpy as np
import pytest

from helpers.sets_on_disk import (
    BOX,
    OTHER,
    SIZE_WH,
    mask_of,
    opened,
    scene,
    write_coco,
    write_image,
    write_voc,
)
from ssiam.datasets import DatasetError


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
        with pytest.raises(DatasetError, match="is not inside"):
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
