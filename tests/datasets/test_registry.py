"""`open_dataset`: recognition of layouts, lazy reading, links, and errors."""

from __future__ import annotations

import os

import pytest

from helpers.dataset_errors import error_line
from helpers.datasets_on_disk import boxes, text, write_got10k, write_images, write_lasot, write_vot
from ssiam.datasets import KINDS, DatasetError, UnknownSequenceError, open_dataset
from ssiam.errors import ArgumentError


def test_only_the_kinds_are_accepted(tmp_path):
    assert set(KINDS) == {
        "vot", "pysot", "otb", "uav123", "dtb70", "got10k", "lasot", "mot", "clip", "folder",
    }  # fmt: skip
    write_vot(tmp_path, "ants1")
    for kind in KINDS:
        if kind in ("vot", "folder", "clip"):
            assert list(open_dataset(tmp_path, kind).sequences) == ["ants1"]
        else:
            assert "expected " in error_line(tmp_path, kind)
    with pytest.raises(ArgumentError, match="unknown kind of dataset 'vto': choose from"):
        open_dataset(tmp_path, "vto")


def test_a_sequence_is_read_at_lookup(tmp_path):
    for name in ("airplane-1", "airplane-2"):
        folder = write_lasot(tmp_path, name)
    (folder / "groundtruth.txt").write_text("damaged")
    for image in tmp_path.rglob("*.jpg"):
        image.write_bytes(b"not an image")
    dataset = open_dataset(tmp_path)
    assert len(dataset) == 2
    assert len(dataset.sequences["airplane-1"]) == 3
    with pytest.raises(DatasetError, match="airplane-2"):
        dataset.sequences["airplane-2"]


def test_an_unknown_name_gives_suggestions(tmp_path):
    write_vot(tmp_path, "ants1")
    sequences = open_dataset(tmp_path).sequences
    with pytest.raises(UnknownSequenceError) as caught:
        sequences["ant1"]
    assert str(caught.value) == "no sequence 'ant1' in this dataset; did you mean ants1?"
    assert sequences.get("ant1") is None
    assert "ant1" not in sequences


def test_names_of_datasets(tmp_path, monkeypatch):
    write_vot(tmp_path / "My VOT 2018", "ants1")
    monkeypatch.chdir(tmp_path / "My VOT 2018")
    assert open_dataset(".").name == "My VOT 2018"
    assert open_dataset("ants1").name == "ants1"


INVALID_PATHS = [
    ("missing", "nowhere", "there is no such folder or file"),
    ("other file", "notes.md", "is a file; expected"),
    ("too long", "x" * 5000, "cannot be read"),
    ("zero byte", "a\0b", "there is no such folder or file"),
]


@pytest.mark.parametrize(
    ("name", "message"), [r[1:] for r in INVALID_PATHS], ids=[r[0] for r in INVALID_PATHS]
)
def test_an_invalid_path_is_an_error(tmp_path, name, message):
    (tmp_path / "notes.md").write_text("x")
    assert message in error_line(os.path.join(tmp_path, name))


SPLITS = [
    ("vot has none", lambda root: write_vot(root, "a"), "test", "vot has none"),
    ("unknown", lambda root: write_lasot(root, "cat-1"), "val", "choose from train, test"),
    (
        "missing split",
        lambda root: write_got10k(root, "val", 1),
        "train",
        "has no sequence of the split",
    ),
]


@pytest.mark.parametrize(
    ("write", "split", "message"), [r[1:] for r in SPLITS], ids=[r[0] for r in SPLITS]
)
def test_an_invalid_split_is_an_error(tmp_path, write, split, message):
    write(tmp_path)
    assert message in error_line(tmp_path, split=split)


def test_loops_of_links_are_skipped(tmp_path):
    write_vot(tmp_path, "ants1")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "up").symlink_to(tmp_path, target_is_directory=True)
    (tmp_path / "ants1" / "00000004.jpg").symlink_to("00000004.jpg")
    dataset = open_dataset(tmp_path)
    assert list(dataset.sequences) == ["ants1"]
    assert len(dataset.sequences["ants1"]) == 3
    (tmp_path / "ants1" / "groundtruth.txt").unlink()
    (tmp_path / "ants1" / "groundtruth.txt").symlink_to("groundtruth.txt")
    assert "expected" in error_line(tmp_path)
    assert "there is no such" in error_line(tmp_path / "loop")


def test_a_folder_removed_after_opening_is_an_error(tmp_path):
    folder = write_vot(tmp_path, "ants1")
    dataset = open_dataset(tmp_path)
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
    with pytest.raises(DatasetError, match="has no images"):
        dataset.sequences["ants1"]


def test_linked_sequences_are_opened(tmp_path):
    write_vot(tmp_path / "elsewhere", "ants1")
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "linked").symlink_to(tmp_path / "elsewhere" / "ants1")
    assert len(open_dataset(tmp_path / "here").sequences["linked"]) == 3


def test_a_pipe_as_box_file_does_not_block(tmp_path):
    write_images(tmp_path / "mine", range(1, 4), 3)
    os.mkfifo(tmp_path / "mine" / "groundtruth.txt")
    assert "expected" in error_line(tmp_path)
    (tmp_path / "mine.txt").write_text(text(boxes(3)))
    assert list(open_dataset(tmp_path).sequences) == ["mine"]
