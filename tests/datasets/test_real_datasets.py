"""Real sequences and ground truth, if the shared data is available."""

from __future__ import annotations

import numpy as np

from ssiam.datasets import open_dataset

# Name: frames, first and last image, first box as 0-based x, y, w, h.
SEQUENCES = {
    "Bolt2": (293, "0001.jpg", "0293.jpg", (268, 74, 34, 64)),
    "Couple": (140, "0001.jpg", "0140.jpg", (50, 46, 25, 62)),
    "Crossing": (120, "0001.jpg", "0120.jpg", (204, 150, 17, 50)),
    "David": (471, "0300.jpg", "0770.jpg", (128, 79, 64, 78)),
    "Jumping": (313, "0001.jpg", "0313.jpg", (146, 109, 34, 33)),
    "MotorRolling": (164, "0001.jpg", "0164.jpg", (116, 67, 122, 125)),
    "Skiing": (81, "0001.jpg", "0081.jpg", (445, 180, 29, 26)),
    "dtb70_MountainBike6": (81, "00001.jpg", "00081.jpg", (618, 329, 53, 46)),
    "uav123_wakeboard7": (67, "000001.jpg", "000067.jpg", (623, 299, 11, 38)),
}


def test_sequences(shared):
    dataset = open_dataset(shared("data/sequences"))
    assert (dataset.name, dataset.kind) == ("sequences", "folder")
    assert set(dataset.sequences) == {*SEQUENCES, "bag_vot2015"}
    for name, (count, first, last, box) in SEQUENCES.items():
        sequence = dataset.sequences[name]
        assert (len(sequence), len(sequence.truth)) == (count, count)
        assert (sequence.frames[0].name, sequence.frames[-1].name) == (first, last)
        assert sequence.box(0) == box
    assert dataset.sequences["bag_vot2015"].truth.shape == (196, 8)


def test_the_first_box_is_inside_of_the_image(shared):
    dataset = open_dataset(shared("data/sequences"))
    for sequence in dataset.sequences.values():
        image = next(sequence.images())
        x, y, w, h = sequence.box(0)
        height, width = image.shape[:2]
        assert 0 <= x < x + w <= width + 1
        assert 0 <= y < y + h <= height + 1


def test_a_single_sequence_is_a_dataset(shared):
    dataset = open_dataset(shared("data/sequences/David"), as_published=True)
    assert (dataset.name, dataset.kind, list(dataset.sequences)) == ("David", "otb", ["David"])
    assert dataset.sequences["David"].box(0) == (129, 80, 64, 78)


def test_vot2018(shared):
    dataset = open_dataset(shared("data/vot/VOT2018.json"))
    assert (dataset.name, dataset.kind, len(dataset)) == ("VOT2018", "pysot", 60)
    sequences = list(dataset.sequences.values())
    assert sum(len(sequence) for sequence in sequences) == 21356
    assert {sequence.truth.shape[1] for sequence in sequences} == {4, 8}
    tags = {"camera_motion", "illum_change", "motion_change", "size_change", "occlusion"}
    assert all(set(sequence.tags) == tags for sequence in sequences)
    assert not dataset.sequences["matrix"].tags["camera_motion"].any()
    assert dataset.sequences["ants1"].size_wh == (1024, 1024)
    assert all(np.isfinite(sequence.truth).all() for sequence in sequences)
