"""VOT folders and the JSON file of pysot, written to disk and read back."""

from __future__ import annotations

import json

import numpy as np
import pytest

from helpers.datasets_on_disk import boxes, number_in, only, write_images, write_vot
from ssiam.datasets import open_dataset

VOT_LAYOUTS = [
    ("classic rectangles", {}, 4, None),
    ("classic polygons", {"polygon": True}, 8, None),
    ("toolkit rectangles", {"toolkit": True}, 4, (12, 8)),
    ("toolkit polygons", {"toolkit": True, "polygon": True}, 8, (12, 8)),
]


@pytest.mark.parametrize(
    ("form", "columns", "size_wh"), [r[1:] for r in VOT_LAYOUTS], ids=[r[0] for r in VOT_LAYOUTS]
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
    extra = 1 if columns == 8 else 0
    assert (x + (w - extra) / 2, y + (h - extra) / 2) == (2 + 2.5, 20 + 3)


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
    for source in (path, tmp_path):
        dataset = open_dataset(source)
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
    sequence = only(open_dataset(path))
    assert [number_in(image) for image in sequence.images(1)] == [2, 3]
    assert sequence.tags["Fast Motion"].all()


def test_unknown_boxes_in_json_are_nan(tmp_path):
    path = tmp_path / "LT.json"
    path.write_text(json.dumps({"a": {"img_names": ["1.jpg"], "gt_rect": [[float("nan")] * 4]}}))
    assert open_dataset(path).sequences["a"].truth.tolist() != [[0, 0, 0, 0]]
