"""UAV123, DTB70, GOT-10k, LaSOT, and several layouts in one folder, written and read back."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.datasets_on_disk import (
    boxes,
    frame_numbers,
    only,
    text,
    write_got10k,
    write_images,
    write_lasot,
    write_otb,
    write_uav123,
    write_vot,
)
from ssiam.datasets import DatasetError, open_dataset
from ssiam.datasets.lasot import TEST_SPLIT
from ssiam.datasets.uav123 import PARTS


def test_uav123(tmp_path):
    write_uav123(tmp_path, "bike1", "bike1", range(1, 8), boxes(5))
    write_uav123(tmp_path, "bird1_1", "bird1", range(1, 1500), boxes(253))
    write_uav123(tmp_path, "bird1_2", "bird1", range(1, 1500), boxes(703))
    (tmp_path / "anno" / "UAV123" / "att").mkdir()
    (tmp_path / "anno" / "UAV123" / "att" / "bike1.txt").write_text("1,0,0,0,0,0,0,0,0,0,1,0")
    dataset = open_dataset(tmp_path)
    assert (dataset.kind, list(dataset.sequences)) == ("uav123", ["bike1", "bird1_1", "bird1_2"])
    bike = dataset.sequences["bike1"]
    assert frame_numbers(bike) == [1, 2, 3, 4, 5]
    assert np.array_equal(bike.truth, boxes(5))
    assert {tag: flags.tolist() for tag, flags in bike.tags.items()} == {
        "scale_variation": [True] * 5,
        "camera_motion": [True] * 5,
    }
    assert frame_numbers(dataset.sequences["bird1_1"]) == list(range(1, 254))
    assert frame_numbers(dataset.sequences["bird1_2"]) == list(range(775, 1478))


def test_uav123_versions(tmp_path):
    write_uav123(tmp_path, "bird1_2", "bird1", range(1, 600), boxes(235), version="UAV123_10fps")
    write_uav123(tmp_path, "car1", "car1", range(1, 31), boxes(30))
    (tmp_path / "anno" / "UAV20L").mkdir()
    (tmp_path / "anno" / "UAV20L" / "car1.txt").write_text(text(boxes(30)))
    slow = open_dataset(tmp_path, split="uav123_10fps").sequences["bird1_2"]
    assert frame_numbers(slow) == list(range(259, 494))
    assert len(only(open_dataset(tmp_path, split="uav20l"))) == 30
    assert list(open_dataset(tmp_path).sequences) == ["car1"]


def test_uav123_10fps_downloaded_alone(tmp_path):
    root = tmp_path / "UAV123_10fps"
    write_images(root / "data_seq" / "bird1", range(1, 600), 6)
    (root / "anno").mkdir()
    (root / "anno" / "bird1_2.txt").write_text(text(boxes(235)))
    assert frame_numbers(only(open_dataset(root))) == list(range(259, 494))


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
    sequence = only(open_dataset(tmp_path, split="val"))
    assert np.array_equal(sequence.truth[:2], boxes(2))
    assert np.isnan(sequence.truth[2]).all()
    assert {tag: flags.tolist() for tag, flags in sequence.tags.items()} == {
        "absence": [False, False, True],
        "cut_by_image": [False, True, False],
        "occlusion": [False, True, True],
    }
    tested = only(open_dataset(tmp_path, split="test"))
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


def test_lasot_has_280_test_sequences():
    assert len(TEST_SPLIT) == 70
    assert all(len(set(numbers)) == 4 for numbers in TEST_SPLIT.values())


def test_parts_of_uav123_are_in_order_and_do_not_overlap():
    for name, (video, first, last) in PARTS.items():
        stem, _, number = name.rpartition("_")
        assert stem == video
        before = PARTS.get(f"{stem}_{int(number) - 1}")
        assert (before[2] if before else 1) <= first < last


def test_mixed_layouts_in_one_folder(tmp_path):
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
