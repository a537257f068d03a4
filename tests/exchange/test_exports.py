"""Properties of all export formats: errors, determinism, names."""

from __future__ import annotations

import json
import os
from zipfile import ZipFile

import pytest

from ssiam.errors import ArgumentError, SinkError
from ssiam.exchange import EXPORT_KINDS, Annotation, Annotations, write_exports

NEEDS_FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")


@pytest.mark.parametrize("kind", EXPORT_KINDS)
def test_equal_annotations_give_equal_bytes(annotations, tmp_path, kind):
    path = tmp_path / "export"
    path.write_bytes(b"older" * 10_000)
    write_exports(annotations, path, kind)
    first = path.read_bytes()
    write_exports(annotations, path, kind)
    assert path.read_bytes() == first
    assert b"older" not in first


@pytest.mark.parametrize("kind", EXPORT_KINDS)
@pytest.mark.parametrize(
    ("name", "words"),
    [
        pytest.param("none/export", "there is no folder", id="no folder"),
        pytest.param("folder", "is a folder", id="folder"),
        pytest.param("full", "No space left on device", id="disk full", marks=NEEDS_FULL),
    ],
)
def test_unwritable_exports_raise_sink_error(annotations, tmp_path, kind, name, words):
    (tmp_path / "folder").mkdir()
    (tmp_path / "full").symlink_to("/dev/full")
    with pytest.raises(SinkError, match=words):
        write_exports(annotations, tmp_path / name, kind)


@pytest.mark.parametrize("kind", EXPORT_KINDS)
def test_export_without_targets(tmp_path, kind):
    path = tmp_path / "export"
    write_exports(Annotations((200, 100), 25, (), ()), path, kind)
    assert path.stat().st_size > 0


def test_unknown_kind_is_refused(annotations, tmp_path):
    with pytest.raises(ArgumentError, match="unknown kind of export 'voc': choose from cvat, coco"):
        write_exports(annotations, tmp_path / "export", "voc")


def test_target_that_is_never_visible_is_not_exported(tmp_path):
    row = Annotation(0, None, 1, (1.0, 2.0, 3.0, 4.0), lost=True)
    annotations = Annotations((200, 100), 25, ("boat",), (row,))
    path = tmp_path / "export"
    write_exports(annotations, path, "cvat")
    assert "<track" not in path.read_text()
    write_exports(annotations, path, "labelstudio")
    assert json.loads(path.read_text())[0]["predictions"][0]["result"] == []


FOLDERS = [
    # name of the case, names of the targets, folders of the zip
    ("plain", ["boat", "walker"], ["boat", "walker"]),
    ("same", ["boat", "boat", "Boat"], ["boat", "boat_2", "Boat_3"]),
    ("taken", ["boat", "boat_2", "boat"], ["boat", "boat_2", "boat_3"]),
    ("path traversal", ["../../etc", "/root", "..", "."], ["etc", "root", "target", "target_2"]),
    ("windows", ["C:\\x", "a*?b"], ["C_x", "a_b"]),
    ("the list itself", ["list.txt"], ["list.txt_2"]),
    ("letters", ["Möwe 1", "船"], ["Möwe_1", "船"]),
    ("long", ["x" * 300], ["x" * 60]),
]


@pytest.mark.parametrize(
    ("names", "folders"), [pytest.param(*case, id=name) for name, *case in FOLDERS]
)
def test_got10k_folder_names_are_safe_and_unique(tmp_path, names, folders):
    rows = tuple(Annotation(0, None, i, (1.0, 2.0, 3.0, 4.0)) for i in range(1, len(names) + 1))
    path = tmp_path / "got.zip"
    write_exports(Annotations((200, 100), 25, tuple(names), rows), path, "got10k")
    with ZipFile(path) as archive:
        assert archive.read("list.txt").decode().splitlines() == folders
        inside = [name.split("/") for name in archive.namelist() if name != "list.txt"]
    assert {parts[0] for parts in inside} == set(folders)
    assert {len(parts) for parts in inside} == {2}


@pytest.mark.parametrize(
    ("xywh", "cut"),
    [
        pytest.param((0.0, 0.0, 200.0, 100.0), "0", id="fills the frame"),
        pytest.param((-0.1, 10.0, 20.0, 20.0), "1", id="left"),
        pytest.param((10.0, -0.1, 20.0, 20.0), "1", id="top"),
        pytest.param((190.0, 10.0, 10.1, 20.0), "1", id="right"),
        pytest.param((10.0, 90.0, 20.0, 10.1), "1", id="bottom"),
    ],
)
def test_boxes_cut_by_the_frame(tmp_path, xywh, cut):
    path = tmp_path / "got.zip"
    rows = (Annotation(0, None, 1, xywh),)
    write_exports(Annotations((200, 100), 25, ("boat",), rows), path, "got10k")
    with ZipFile(path) as archive:
        assert archive.read("boat/cut_by_image.label").decode() == f"{cut}\n"
