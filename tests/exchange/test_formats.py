"""Exact contents of each export format."""

from __future__ import annotations

import configparser
import json
from dataclasses import replace
from xml.etree import ElementTree
from zipfile import ZipFile

import cv2
import numpy as np
import pytest

from ssiam.datasets import open_dataset
from ssiam.exchange import write_exports

FIRST, SECOND = 'boat & "<crew>"', "boat 2"


@pytest.fixture
def exported(annotations, tmp_path):
    def write(kind, video="clip & co.mp4"):
        path = tmp_path / f"export.{kind}"
        write_exports(annotations, path, kind, video)
        return path

    return write


def test_cvat(exported):
    root = ElementTree.parse(exported("cvat")).getroot()
    assert (root.tag, root.findtext("version")) == ("annotations", "1.1")
    task = root.find("meta/task")
    fields = {each.tag: each.text for each in task if not len(each)}
    assert fields == {
        **{"name": "clip & co.mp4", "size": "6", "mode": "interpolation", "overlap": "0"},
        "source": "clip & co.mp4",
    }
    assert [each.text for each in task.iterfind("labels/label/name")] == [FIRST, SECOND]
    assert [each.text for each in task.find("original_size")] == ["200", "100"]
    first, second = root.findall("track")
    assert first.attrib == {"id": "1", "label": FIRST, "source": "auto"}
    assert second.attrib == {"id": "2", "label": SECOND, "source": "auto"}
    assert [(box.get("frame"), box.get("outside")) for box in first] == [
        ("0", "0"),
        ("1", "0"),
        ("2", "1"),
        ("4", "0"),
        ("5", "0"),
    ]
    assert dict(first[1].attrib) == {
        **{"frame": "1", "outside": "0", "occluded": "0", "keyframe": "1", "z_order": "0"},
        **{"xtl": "11.0", "ytl": "20.5", "xbr": "41.25", "ybr": "60.5"},
    }
    assert dict(first[2].attrib) == dict(first[1].attrib) | {"frame": "2", "outside": "1"}


def test_cvat_rotates_boxes_about_their_center(exported):
    track = ElementTree.parse(exported("cvat")).getroot().findall("track")[1]
    assert [(box.get("frame"), box.get("outside")) for box in track] == [
        ("1", "0"),
        ("2", "0"),
        ("3", "1"),
    ]
    sides = [track[0].get(name) for name in ("xtl", "ytl", "xbr", "ybr", "rotation")]
    assert sides == ["80.0", "40.0", "120.0", "60.0", "30.0"]


def test_coco(exported):
    content = json.loads(exported("coco").read_text())
    assert content["images"] == [
        {"id": i + 1, "file_name": f"frame_00000{i}.jpg", "width": 200, "height": 100}
        for i in range(6)
    ]
    assert content["categories"] == [
        {"id": 1, "name": FIRST, "supercategory": ""},
        {"id": 2, "name": SECOND, "supercategory": ""},
    ]
    found = content["annotations"]
    assert [each["id"] for each in found] == [1, 2, 3, 4, 5, 6]
    indices = [(each["image_id"], each["track_id"]) for each in found]
    assert indices == [(1, 1), (2, 1), (2, 2), (3, 2), (5, 1), (6, 1)]
    assert found[1] == {
        **{"id": 2, "image_id": 2, "category_id": 1, "track_id": 1, "iscrowd": 0},
        **{"bbox": [11.0, 20.5, 30.25, 40.0], "area": 1210.0, "segmentation": []},
        "attributes": {"score": 0.9, "track_id": 1, "keyframe": False},
    }
    assert found[2] == {
        **{"id": 3, "image_id": 2, "category_id": 2, "track_id": 2, "iscrowd": 0},
        **{"bbox": [77.679, 31.34, 44.641, 37.321], "area": 800.0},
        "segmentation": [[87.679, 31.34, 122.321, 51.34, 112.321, 68.66, 77.679, 48.66]],
        "attributes": {"score": 0.1235, "track_id": 2, "keyframe": False},
    }


def test_targets_with_equal_names_share_a_category(annotations, tmp_path):
    annotations = replace(annotations, names=("boat", "boat"))
    path = tmp_path / "export"
    write_exports(annotations, path, "coco")
    content = json.loads(path.read_text())
    assert [each["name"] for each in content["categories"]] == ["boat"]
    assert {(each["category_id"], each["track_id"]) for each in content["annotations"]} == {
        (1, 1),
        (1, 2),
    }
    write_exports(annotations, path, "cvat")
    labels = ElementTree.parse(path).getroot().findall("meta/task/labels/label")
    assert [label.findtext("name") for label in labels] == ["boat"]


def test_label_studio(exported):
    (task,) = json.loads(exported("labelstudio").read_text())
    assert task["data"] == {"video": "clip & co.mp4"}
    (prediction,) = task["predictions"]
    first, second = prediction["result"]
    heading = {"type": "videorectangle", "from_name": "box", "to_name": "video"}
    for result, number, name in ((first, 1, FIRST), (second, 2, SECOND)):
        assert heading | {"id": f"target-{number}"} == {
            key: value for key, value in result.items() if key != "value"
        }
        assert result["value"]["labels"] == [name]
        assert (result["value"]["framesCount"], result["value"]["duration"]) == (6, 0.24)
    sequence = first["value"]["sequence"]
    assert [(each["frame"], each["enabled"]) for each in sequence] == [
        (1, True),
        (2, False),
        (5, True),
        (6, True),
    ]
    assert sequence[1] == {
        **{"frame": 2, "time": 0.08, "enabled": False, "rotation": 0.0},
        **{"x": 5.5, "y": 20.5, "width": 15.125, "height": 40.0},
    }


def test_label_studio_rotates_boxes_about_their_corner(exported):
    (task,) = json.loads(exported("labelstudio").read_text())
    sequence = task["predictions"][0]["result"][1]["value"]["sequence"]
    assert [(each["frame"], each["enabled"]) for each in sequence] == [(2, True), (3, False)]
    values = [sequence[0][name] for name in ("x", "y", "width", "height", "rotation")]
    assert values == [43.839746, 31.339746, 20.0, 20.0, 30.0]


def test_got10k_is_read_back(exported, tmp_path):
    with ZipFile(exported("got10k")) as archive:
        archive.extractall(tmp_path / "got")
    names = (tmp_path / "got" / "list.txt").read_text().split()
    assert names == ["boat_crew", "boat_2"]
    for name in names:
        for frame in range(6):
            path = tmp_path / "got" / name / f"{frame + 1:08d}.jpg"
            cv2.imwrite(str(path), np.zeros((100, 200, 3), np.uint8))
    dataset = open_dataset(tmp_path / "got", "got10k")
    first, second = (dataset.sequences[name] for name in names)
    nan = [np.nan] * 4
    np.testing.assert_array_equal(
        first.truth,
        [nan if x is None else [x, 20.5, 30.25, 40] for x in (10, 11, None, None, 14, 15)],
    )
    box = [80, 30, 40, 40]
    np.testing.assert_array_equal(second.truth, [nan, box, box, nan, nan, nan])
    assert first.tags["absence"].tolist() == [False, False, True, True, False, False]
    assert second.tags["absence"].tolist() == [True, False, False, True, True, True]
    assert first.tags["occlusion"].tolist() == first.tags["absence"].tolist()
    assert not first.tags["cut_by_image"].any()


def test_got10k_file_contents(exported):
    with ZipFile(exported("got10k")) as archive:
        truth = archive.read("boat_crew/groundtruth.txt").decode().splitlines()
        meta = archive.read("boat_crew/meta_info.ini").decode()
    assert truth[1:3] == ["11.0000,20.5000,30.2500,40.0000", "0.0000,0.0000,0.0000,0.0000"]
    parser = configparser.ConfigParser(delimiters=(":",), interpolation=None)
    parser.read_string(meta)
    assert dict(parser["METAINFO"]) == {
        **{"url": "clip & co.mp4", "begin": "00:00:00", "end": "00:00:00", "anno_fps": "25Hz"},
        **{"object_class": FIRST, "motion_class": "none", "major_class": "none"},
        **{"root_class": "none", "motion_adverb": "none", "resolution": "(200, 100)"},
    }
    # GOT-10k's toolkit splits the lines at ": ", pytracking relies on their order.
    assert [len(line.split(": ")) for line in meta.splitlines()[1:]] == [2] * 10
    assert meta.splitlines()[5] == f"object_class: {FIRST}"
