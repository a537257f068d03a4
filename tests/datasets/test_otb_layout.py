"""OTB folders, written to disk and read back."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.datasets_on_disk import boxes, frame_numbers, only, text, write_otb
from ssiam.datasets import open_dataset

# Name, images on disk, rows in the file, used images, and number of the first row.
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
def test_frames_are_selected_by_number(tmp_path, name, images, rows, used, first_row):
    folder = write_otb(tmp_path, name, images, boxes(rows))
    sequence = only(open_dataset(folder))
    assert frame_numbers(sequence) == list(used)
    assert len(sequence.truth) == len(used)
    assert sequence.truth[0].tolist() == [first_row - 1, 10 * first_row - 1, 5, 6]


@pytest.mark.parametrize("separator", [",", "\t", " "])
def test_boxes_become_0_based_unless_as_published(tmp_path, separator):
    rows = [*boxes(2), (0, 0, 0, 0)]
    folder = write_otb(tmp_path, "Walking", range(1, 4), rows, separator=separator)
    sequence = only(open_dataset(folder))
    assert sequence.truth[:2].tolist() == [[0, 9, 5, 6], [1, 19, 5, 6]]
    assert np.isnan(sequence.truth[2]).all()
    published = only(open_dataset(folder, as_published=True))
    assert np.array_equal(published.truth, rows)


def test_folders_with_two_targets(tmp_path):
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


def test_copies_of_folders_as_used_by_pysot(tmp_path):
    for name in ("Jogging", "Jogging-1", "Jogging.2"):
        write_otb(tmp_path, name, range(1, 4), boxes(3), file="groundtruth_rect.2.txt")
        (tmp_path / name / "groundtruth_rect.1.txt").write_text(text(boxes(3, first=7)))
    dataset = open_dataset(tmp_path)
    assert list(dataset.sequences) == ["Jogging-1", "Jogging-2"]
    assert list(open_dataset(tmp_path / "Jogging.2").sequences) == ["Jogging-2"]
