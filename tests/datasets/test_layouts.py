"""Every layout, written to disk and read back."""

from __future__ import annotations

import json

import numpy as np
import pytest
from on_disk import (
    boxes,
    number_in,
    text,
    write_got10k,
    write_images,
    write_lasot,
    write_otb,
    write_uav123,
    write_vot,
)

from ssiam.datasets import DatasetError, open_dataset
from ssiam.datasets.lasot_split import TEST
from ssiam.datasets.uav123_ranges import PARTS


def _only(dataset):
    (name,) = dataset.sequences
    return dataset.sequences[name]


def _numbers(sequence):
    return [int(path.stem) for path in sequence.frames]


VOT_FORMS = [
    ("classic rectangles", {}, 4, None),
    ("classic polygons", {"polygon": True}, 8, None),
    ("toolkit rectangles", {"toolkit": True}, 4, (12, 8)),
    ("toolkit polygons", {"toolkit": True, "polygon": True}, 8, (12, 8)),
]


@pytest.mark.parametrize(
    ("form", "columns", "size_wh"), [r[1:] for r in VOT_FORMS], ids=[r[0] for r in VOT_FORMS]
)
def test_vot(tmp_path, form, columns, size_wh):
    tags = {"camera_motion.tag": (1, 0, 1), "occlusion.label": (0, 1), "empty.tag": ()}
    write_vot(tmp_path, "two words", **form, tags=tags)
    write_vot(tmp_path, "ants1", **form)
    write_vot(tmp_path, "left out", **form)
    (tmp_path / "list.txt").write_text("two words\nants1\n")
    dataset = open_dataset(tmp_path)
    assert (dataset.kind, list(dataset.sequences)) == ("vot", ["two words", "ants1"])
    sequence = dataset.sequences["two words"]
    assert sequence.truth.shape == (3, columns)
    assert sequence.size_wh == size_wh
    assert {tag: flags.tolist() for tag, flags in sequence.tags.items()} == {
        "camera_motion": [True, False, True],
        "occlusion": [False, True, False],
        "empty": [False, False, False],
    }
    assert [number_in(image) for image in sequence.images()] == [1, 2, 3]
    x, y, w, h = sequence.box(1)
    grown = 1 if columns == 8 else 0
    assert (x + (w - grown) / 2, y + (h - grown) / 2) == (2 + 2.5, 20 + 3)


# Name, images on disk, rows in the file, images that are used, and the first row's number.
OTB_RANGES = [
    ("David", range(1, 771), 471, range(300, 771), 1),
    ("David", range(300, 771), 471, range(300, 771), 1),
    ("David", range(1, 472), 471, range(1, 472), 1),
    ("David", range(300, 310), 10, range(300, 310), 1),
    ("Football1", range(1, 82), 74, range(1, 75), 1),
    ("Freeman3", range(1, 475), 460, range(1, 461), 1),
    ("Freeman4", range(1, 298), 283, range(1, 284), 1),
    ("Diving", range(1, 232), 215, range(1, 216), 1),
    ("BlurCar1", range(247, 989), 742, range(247, 989), 1),
    ("BlurCar3", range(3, 360), 357, range(3, 360), 1),
    ("BlurCar4", range(18, 398), 380, range(18, 398), 1),
    ("Tiger1", range(1, 355), 354, range(6, 355), 6),
    ("Tiger1", range(1, 355), 349, range(6, 355), 1),
    ("Walking", range(1, 31), 30, range(1, 31), 1),
]


@pytest.mark.parametrize(("name", "images", "rows", "used", "first_row"), OTB_RANGES)
def test_otb_frames_are_chosen_by_number(tmp_path, name, images, rows, used, first_row):
    folder = write_otb(tmp_path, name, images, boxes(rows))
    sequence = _only(open_dataset(folder))
    assert _numbers(sequence) == list(used)
    assert len(sequence.truth) == len(used)
    assert sequence.truth[0].tolist() == [first_row - 1, 10 * first_row - 1, 5, 6]


@pytest.mark.parametrize("separator", [",", "\t", " "])
def test_otb_boxes_become_0_based_unless_as_published(tmp_path, separator):
    rows = [*boxes(2), (0, 0, 0, 0)]
    folder = write_otb(tmp_path, "Walking", range(1, 4), rows, separator=separator)
    sequence = _only(open_dataset(folder))
    assert sequence.truth[:2].tolist() == [[0, 9, 5, 6], [1, 19, 5, 6]]
    assert np.isnan(sequence.truth[2]).all()
    published = _only(open_dataset(folder, as_published=True))
    assert np.array_equal(published.truth, rows)


def test_otb_folders_with_two_targets(tmp_path):
    for name in ("Jogging", "Skating2", "Human4"):
        write_otb(tmp_path, name, range(1, 4), boxes(3), file="groundtruth_rect.2.txt")
        (tmp_path / name / "groundtruth_rect.1.txt").write_text(text(boxes(3, first=7)))
    (tmp_path / "Human4" / "groundtruth_rect.1.txt").write_text("\n")
    write_otb(tmp_path, "Board", range(1, 4), boxes(3), digits=5)
    dataset = open_dataset(tmp_path)
    assert dataset.kind == "otb"
    assert list(dataset.sequences) == [
        "Board",
        "Human4-2",
        "Jogging-1",
        "Jogging-2",
        "Skating2-1",
        "Skating2-2",
    ]
    for spelling in ("Jogging-1", "Jogging.1", "Jogging_1"):
        assert spelling in dataset.sequences
        sequence = dataset.sequences[spelling]
        assert (sequence.name, sequence.truth[0, 0]) == ("Jogging-1", 6)
    assert list(open_dataset(tmp_path, split="otb50").sequences) == [
        "Human4-2",
        "Skating2-1",
        "Skating2-2",
    ]


def test_otb_with_the_copies_that_pysot_asks_for(tmp_path):
    for name in ("Jogging", "Jogging-1", "Jogging.2"):
        write_otb(tmp_path, name, range(1, 4), boxes(3), file="groundtruth_rect.2.txt")
        (tmp_path / name / "groundtruth_rect.1.txt").write_text(text(boxes(3, first=7)))
    dataset = open_dataset(tmp_path)
    assert list(dataset.sequences) == ["Jogging-1", "Jogging-2"]
    assert list(open_dataset(tmp_path / "Jogging.2").sequences) == ["Jogging-2"]


def test_uav123(tmp_path):
    write_uav123(tmp_path, "bike1", "bike1", range(1, 8), boxes(5))
    write_uav123(tmp_path, "bird1_1", "bird1", range(1, 1500), boxes(253))
    write_uav123(tmp_path, "bird1_2", "bird1", range(1, 1500), boxes(703))
    (tmp_path / "anno" / "UAV123" / "att").mkdir()
    (tmp_path / "anno" / "UAV123" / "att" / "bike1.txt").write_text("1,0,0,0,0,0,0,0,0,0,1,0")
    dataset = open_dataset(tmp_path)
    assert (dataset.kind, list(dataset.sequences)) == ("uav123", ["bike1", "bird1_1", "bird1_2"])
    bike = dataset.sequences["bike1"]
    assert _numbers(bike) == [1, 2, 3, 4, 5]
    assert np.array_equal(bike.truth, boxes(5))
    assert {tag: flags.tolist() for tag, flags in bike.tags.items()} == {
        "scale_variation": [True] * 5,
        "camera_motion": [True] * 5,
    }
    assert _numbers(dataset.sequences["bird1_1"]) == list(range(1, 254))
    assert _numbers(dataset.sequences["bird1_2"]) == list(range(775, 1478))


def test_uav123_versions(tmp_path):
    write_uav123(tmp_path, "bird1_2", "bird1", range(1, 600), boxes(235), part="UAV123_10fps")
    write_uav123(tmp_path, "car1", "car1", range(1, 31), boxes(30))
    (tmp_path / "anno" / "UAV20L").mkdir()
    (tmp_path / "anno" / "UAV20L" / "car1.txt").write_text(text(boxes(30)))
    slow = open_dataset(tmp_path, split="uav123_10fps").sequences["bird1_2"]
    assert _numbers(slow) == list(range(259, 494))
    assert len(_only(open_dataset(tmp_path, split="uav20l"))) == 30
    assert list(open_dataset(tmp_path).sequences) == ["car1"]


def test_uav123_10fps_alone(tmp_path):
    root = tmp_path / "UAV123_10fps"
    write_images(root / "data_seq" / "bird1", range(1, 600), 6)
    (root / "anno").mkdir()
    (root / "anno" / "bird1_2.txt").write_text(text(boxes(235)))
    assert _numbers(_only(open_dataset(root))) == list(range(259, 494))


def test_dtb70(tmp_path):
    for name in ("Animal1", "Basketball"):
        write_otb(tmp_path, name, range(1, 4), boxes(3), digits=5)
    dataset = open_dataset(tmp_path)
    assert (dataset.kind, list(dataset.sequences)) == ("dtb70", ["Animal1", "Basketball"])
    assert np.array_equal(dataset.sequences["Animal1"].truth, boxes(3))


def test_got10k(tmp_path):
    absent = [*boxes(2), (-1, -1, -1, -1)]
    folder = write_got10k(tmp_path, "val", 1, rows=absent)
    (folder / "absence.label").write_text("0\n0\n1\n")
    (folder / "cover.label").write_text("8\n5\n0\n")
    (folder / "cut_by_image.label").write_text("0\n1\n0\n")
    (folder / "meta_info.ini").write_text("[METAINFO]\nobject_class: dog\n")
    write_got10k(tmp_path, "test", 1, rows=boxes(1))
    dataset = open_dataset(tmp_path)
    assert (dataset.kind, len(dataset)) == ("got10k", 2)
    assert list(open_dataset(tmp_path / "val").sequences) == ["GOT-10k_Val_000001"]
    sequence = _only(open_dataset(tmp_path, split="val"))
    assert np.array_equal(sequence.truth[:2], boxes(2))
    assert np.isnan(sequence.truth[2]).all()
    assert {tag: flags.tolist() for tag, flags in sequence.tags.items()} == {
        "absence": [False, False, True],
        "cut_by_image": [False, True, False],
        "occlusion": [False, True, True],
    }
    tested = _only(open_dataset(tmp_path, split="test"))
    assert (len(tested), len(tested.truth)) == (3, 1)


def test_lasot(tmp_path):
    write_lasot(tmp_path, "airplane-1", rows=[*boxes(2), (0, 0, 0, 0)])
    write_lasot(tmp_path, "airplane-2")
    write_lasot(tmp_path, "zebra-10")
    dataset = open_dataset(tmp_path)
    assert (dataset.kind, len(dataset)) == ("lasot", 3)
    assert list(open_dataset(tmp_path, split="test").sequences) == ["airplane-1", "zebra-10"]
    assert list(open_dataset(tmp_path, split="train").sequences) == ["airplane-2"]
    sequence = dataset.sequences["airplane-1"]
    assert sequence.truth[:2].tolist() == [[0, 9, 5, 6], [1, 19, 5, 6]]
    assert np.isnan(sequence.truth[2]).all()
    assert sequence.tags["full_occlusion"].tolist() == [False, False, True]
    assert not sequence.tags["out_of_view"].any()
    published = open_dataset(tmp_path, as_published=True).sequences["airplane-1"]
    assert published.truth[2].tolist() == [0, 0, 0, 0]


def test_whole_test_split_of_lasot_is_280():
    assert len(TEST) == 70
    assert all(len(set(numbers)) == 4 for numbers in TEST.values())


def test_parts_of_uav123_follow_each_other():
    for name, (video, first, last) in PARTS.items():
        stem, _, number = name.rpartition("_")
        assert stem == video
        before = PARTS.get(f"{stem}_{int(number) - 1}")
        assert (before[2] if before else 1) <= first < last


def _record(name, count, **more):
    return {
        "video_dir": name,
        "init_rect": [1, 10, 5, 6],
        "img_names": [f"{name}/color/{i:08}.jpg" for i in range(1, count + 1)],
        "gt_rect": boxes(count).tolist(),
        "camera_motion": [1] + [0] * (count - 1),
        "occlusion": [],
        "width": 12,
        "height": 8,
        **more,
    }


def test_pysot_without_images(tmp_path):
    path = tmp_path / "VOT2018.json"
    path.write_text(json.dumps({"ants1": _record("ants1", 3), "bag": _record("bag", 2)}))
    for place in (path, tmp_path):
        dataset = open_dataset(place)
        assert (dataset.kind, list(dataset.sequences)) == ("pysot", ["ants1", "bag"])
    assert open_dataset(path).name == "VOT2018"
    sequence = dataset.sequences["ants1"]
    assert len(sequence) == 3
    assert np.array_equal(sequence.truth, boxes(3))
    assert sequence.size_wh == (12, 8)
    assert sequence.tags["camera_motion"].tolist() == [True, False, False]
    assert sequence.tags["occlusion"].tolist() == [False, False, False]


@pytest.mark.parametrize("inner", ["", "VOT2018"])
def test_pysot_finds_its_images(tmp_path, inner):
    write_images(tmp_path / inner / "ants1" / "color", range(1, 4), 8)
    path = tmp_path / "VOT2018.json"
    path.write_text(json.dumps({"ants1": _record("ants1", 3, attr=["Fast Motion"])}))
    sequence = _only(open_dataset(path))
    assert [number_in(image) for image in sequence.images(1)] == [2, 3]
    assert sequence.tags["Fast Motion"].all()


def test_mixed_layouts_side_by_side(tmp_path):
    write_otb(tmp_path, "David", range(300, 310), boxes(10))
    write_vot(tmp_path, "bag", polygon=True)
    alone = tmp_path / "uav123_boat7"
    write_images(alone, range(1, 4), 6)
    (alone / "boat7.txt").write_text(text(boxes(3)))
    drone = tmp_path / "dtb70_Gull2"
    write_images(drone / "img", range(1, 4), 5)
    (drone / "Gull2.txt").write_text(text(boxes(3)))
    (tmp_path / "notes").mkdir()
    dataset = open_dataset(tmp_path)
    assert dataset.kind == "folder"
    assert list(dataset.sequences) == ["David", "bag", "dtb70_Gull2", "uav123_boat7"]
    assert [s.truth.shape[1] for s in dataset.sequences.values()] == [4, 8, 4, 4]
    assert [s.truth[0, 0] for s in dataset.sequences.values()] == [0, 1, 1, 1]
    kinds = {name: open_dataset(tmp_path / name).kind for name in dataset.sequences}
    assert list(kinds.values()) == ["otb", "vot", "dtb70", "uav123"]
    assert list(open_dataset(tmp_path, "otb").sequences) == ["David"]
    with pytest.raises(DatasetError, match=r"expected groundtruth\.txt, full_occlusion\.txt"):
        open_dataset(tmp_path, "lasot")
