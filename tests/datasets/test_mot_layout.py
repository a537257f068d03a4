"""MOTChallenge: every object is a sequence, with the boxes of the others."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.dataset_errors import error_line
from helpers.datasets_on_disk import frame_numbers, write_images, write_mot, write_vot
from ssiam.datasets import Shake, open_dataset, shaken

# frame, id, x, y, w, h, flag, class, visibility
WALKERS = [
    (1, 1, 1, 1, 5, 6, 1, 1, 1),
    (2, 1, 2, 1, 5, 6, 1, 1, 0.05),
    (3, 1, 3, 1, 5, 6, 1, 1, 0.5),
    (4, 2, 4, 3, 2, 3, 1, 1, 1),
    (2, 2, 6, 3, 2, 3, 1, 1, 1),
    (2, 3, 7, 3, 2, 3, 0, 1, 1),
    (2, 4, 7, 3, 2, 3, 1, 7, 1),
    (2, 5, 7, 3, 2, 3, 1, 3, 0),
]
NAN = [np.nan] * 4


def test_every_object_is_a_sequence_with_the_boxes_of_the_others(tmp_path):
    write_mot(tmp_path, "street", WALKERS)
    dataset = open_dataset(tmp_path)
    assert (dataset.kind, list(dataset.sequences)) == ("mot", ["street-1", "street-2"])
    one, two = dataset.sequences.values()
    assert frame_numbers(one) == [1, 2, 3]
    assert frame_numbers(two) == [2, 3, 4]
    np.testing.assert_array_equal(one.truth, [(0, 0, 5, 6), NAN, (2, 0, 5, 6)])
    np.testing.assert_array_equal(two.truth, [(5, 2, 2, 3), NAN, (3, 2, 2, 3)])
    assert list(one.others) == ["street-2"]
    np.testing.assert_array_equal(one.others["street-2"], [NAN, (5, 2, 2, 3), NAN])
    np.testing.assert_array_equal(one.other_boxes(1), [(5, 2, 2, 3)])
    assert two.other_boxes(0).shape == (0, 4)
    assert one.size_wh == (12, 8)


def test_objects_in_other_frames_are_left_out_of_others(tmp_path):
    rows = [(1, 1, 1, 1, 5, 6), (2, 2, 1, 1, 5, 6), (2, 3, 2, 1, 5, 6)]
    sequences = open_dataset(write_mot(tmp_path, "street", rows)).sequences
    assert not sequences["street-1"].others
    assert list(sequences["street-2"].others) == ["street-3"]


def test_a_clip_or_a_split_can_be_opened(tmp_path):
    for name in ("MOT17-02-FRCNN", "MOT17-04-FRCNN"):
        write_mot(tmp_path / "train", name, WALKERS)
    write_images(tmp_path / "test" / "MOT17-01-FRCNN" / "img1", range(1, 3), 6)
    assert len(open_dataset(tmp_path)) == 4
    assert len(open_dataset(tmp_path / "train", "mot")) == 4
    one = open_dataset(tmp_path / "train" / "MOT17-04-FRCNN").sequences
    assert list(one) == ["MOT17-04-FRCNN-1", "MOT17-04-FRCNN-2"]


def test_it_can_be_mixed_with_other_layouts(tmp_path):
    write_mot(tmp_path, "street", WALKERS)
    write_vot(tmp_path, "ants1")
    dataset = open_dataset(tmp_path)
    assert dataset.kind == "folder"
    assert set(dataset.sequences) == {"street-1", "street-2", "ants1"}
    assert not dataset.sequences["ants1"].others


def test_boxes_as_published_are_1_based(tmp_path):
    write_mot(tmp_path, "street", WALKERS)
    one = open_dataset(tmp_path, as_published=True).sequences["street-1"]
    assert one.box(0) == (1, 1, 5, 6)


COLUMNS = [
    ("world", [(1, 1, 1, 1, 5, 6, 1, 7.5, 12.0, -1)]),
    ("results", [(1, 1, 1, 1, 5, 6, 0.25, -1, -1, -1)]),
    ("no class", [(1, 1, 1, 1, 5, 6, 1, -1, -1)]),
    ("only boxes", [(1, 1, 1, 1, 5, 6)]),
    ("last column is not a share", [(1, 1, 1, 1, 5, 6, 1, 1, 0), (2, 1, 1, 1, 5, 6, 1, 1, 666.5)]),
]


@pytest.mark.parametrize("rows", [c[1] for c in COLUMNS], ids=[c[0] for c in COLUMNS])
def test_files_without_class_or_visibility(tmp_path, rows):
    write_mot(tmp_path, "street", rows, info=False)
    one = open_dataset(tmp_path).sequences["street-1"]
    assert len(one) == len(rows)
    assert one.box(0) == (0, 0, 5, 6)
    assert one.size_wh is None


def test_images_without_numbers_are_numbered_in_order(tmp_path):
    folder = write_mot(tmp_path, "street", WALKERS)
    for path in (folder / "img1").iterdir():
        path.rename(path.with_name(f"frame_{path.name}"))
    two = open_dataset(tmp_path).sequences["street-2"]
    assert [path.name for path in two.frames] == [f"frame_00000{n}.jpg" for n in (2, 3, 4)]


def test_seqinfo_names_the_image_folder(tmp_path):
    folder = write_mot(tmp_path, "street", WALKERS)
    (folder / "img1").rename(folder / "frames")
    info = folder / "seqinfo.ini"
    info.write_text(info.read_text().replace("img1", "frames"))
    assert len(open_dataset(tmp_path).sequences["street-1"]) == 3


def test_shake_moves_the_others_with_the_target(tmp_path):
    rows = [(t, i, 3 * i, 3, 2, 3) for t in (1, 2, 3, 4) for i in (1, 2)]
    sequence = open_dataset(write_mot(tmp_path, "street", rows, info=False)).sequences["street-1"]
    shaking = shaken(sequence, Shake(0.05))
    (other,) = shaking.others.values()
    assert abs(shaking.truth[:, :2] - sequence.truth[:, :2]).max() > 0.1
    moved = other[:, :2] - shaking.truth[:, :2]
    np.testing.assert_allclose(moved, [(3, 0)] * 4, atol=0.5)  # the camera rolls a little
    assert shaken(sequence, Shake(0)).others is sequence.others


DAMAGED = [
    ("words", "1,1,a,1,5,6\n", "could not convert string 'a'"),
    ("uneven", "1,1,1,1,5,6\n1,2,1,1,5\n", "number of columns changed"),
    ("few columns", "1,1,1,1,5\n", "has 5 columns"),
    ("empty", "\n", "has no boxes"),
    ("frame 0", "0,1,1,1,5,6\n", "box 1 is 0,1,1,1,5,6"),
    ("fractional frame", "1,1,1,1,5,6\n1.5,1,1,1,5,6\n", "box 2 is 1.5,1,1,1,5,6"),
    ("infinite", "1,1,inf,1,5,6\n", "box 1 is 1,1,inf"),
    ("huge", "1e300,1,1,1,5,6\n", "box 1 is 1e"),
    ("duplicate box", "1,1,1,1,5,6\n1,1,2,1,5,6\n", "frame 1 has two boxes of the id 1"),
    ("no image", "1,1,1,1,5,6\n9,1,1,1,5,6\n", "the images of 5 of them are missing, from 5 on"),
]


@pytest.mark.parametrize(
    ("content", "message"), [r[1:] for r in DAMAGED], ids=[r[0] for r in DAMAGED]
)
def test_damaged_ground_truth_is_an_error_of_one_line(tmp_path, content, message):
    write_mot(tmp_path, "street", content)
    assert message in error_line(tmp_path)


INFOS = [
    ("not an ini file", "\0\0", "is not an .ini file"),
    ("outside", "[Sequence]\nimDir=../elsewhere\n", "is not inside"),
    ("empty folder", "[Sequence]\nimDir=gt\n", "has no images"),
]


@pytest.mark.parametrize(("info", "message"), [r[1:] for r in INFOS], ids=[r[0] for r in INFOS])
def test_damaged_seqinfo_is_an_error_of_one_line(tmp_path, info, message):
    folder = write_mot(tmp_path, "street", WALKERS)
    (folder / "seqinfo.ini").write_text(info)
    assert message in error_line(tmp_path)


def test_validation_clips(shared):
    dataset = open_dataset(shared("data/mot"))
    assert (dataset.kind, len(dataset)) == ("mot", 52)
    for name in ("TUD-Campus-8", "PETS09-S3-MF1-7", "urban-intersection-24"):
        sequence = dataset.sequences[name]
        assert np.isfinite(sequence.truth[[0, -1]]).all()
        assert all(boxes.shape == sequence.truth.shape for boxes in sequence.others.values())
        assert len(sequence.other_boxes(0)) >= 4
