"""Damaged datasets: each is told in one line that names what is wrong."""

from __future__ import annotations

import json
import re

import pytest

from helpers.dataset_refusals import answer
from helpers.datasets_on_disk import (
    boxes,
    write_got10k,
    write_lasot,
    write_otb,
    write_uav123,
    write_vot,
)


def _nothing(root):
    (root / "a").mkdir()
    (root / "notes.md").write_text("x")


def _one_image_less(root):
    (write_vot(root, "ants1") / "00000003.jpg").unlink()


def _one_box_less(root):
    write_otb(root, "Walking", range(1, 5), boxes(3))


def _no_images(root):
    for path in write_lasot(root, "cat-1").rglob("*.jpg"):
        path.unlink()


def _cut_david(root):
    write_otb(root, "David", range(300, 310), boxes(471))


def _polygons_in_otb(root):
    write_otb(root, "Walking", range(1, 4), [[1] * 8] * 3)


def _leading_out(root):
    write_vot(root.parent, "secret")
    (root / "list.txt").write_text("../secret\n")


def _absolute(root):
    (root / "list.txt").write_text(f"{root}\n")


def _endless_name(root):
    (root / "list.txt").write_text("x" * 5000)


def _listed_but_missing(root):
    write_vot(root, "ants1")
    (root / "list.txt").write_text("ants1\nants9\n")


def _empty_list(root):
    (root / "list.txt").write_text("\n")


def _images_elsewhere(root):
    folder = write_vot(root, "ants1", toolkit=True)
    (folder / "sequence").write_text("channels.color=../../%08d.jpg\n")


def _pattern_of_percents(root):
    folder = write_vot(root, "ants1", toolkit=True)
    (folder / "sequence").write_text("channels.color=nowhere/%999999999d.jpg\n")


def _odd_tag(root):
    write_vot(root, "ants1", tags={"occlusion.tag": ("0", "yes", "1")})


def _long_tag(root):
    write_vot(root, "ants1", tags={"occlusion.tag": (0, 1, 1, 0)})


def _short_label(root):
    (write_got10k(root, "val", 1) / "absence.label").write_text("0\n")


def _uav_wrong_count(root):
    write_uav123(root, "bird1_1", "bird1", range(1, 300), boxes(250))


def _uav_hole(root):
    write_uav123(root, "bike1", "bike1", (1, 2, 4, 5), boxes(5))


def _uav_no_video(root):
    write_uav123(root, "bike1", "bike2", (1, 2), boxes(2))


def _twice_one_name(root):
    write_vot(root / "a", "ants1")
    write_vot(root / "b", "ants1")


DAMAGED = [
    ("nothing", _nothing, "expected a folder of sequences .*; found 1 .md, 1 folder \\(a\\)"),
    ("empty folder", lambda root: None, "found an empty folder"),
    ("one image less", _one_image_less, "ants1: 2 images but 3 boxes"),
    ("one box less", _one_box_less, "Walking: 4 images but 3 boxes"),
    ("no images", _no_images, "img: holds no images"),
    ("cut copy with all boxes", _cut_david, "David: 10 images but 471 boxes"),
    ("polygons in OTB", _polygons_in_otb, "holds polygons"),
    ("list leads out", _leading_out, "'../secret' does not lie inside"),
    ("list with absolute path", _absolute, "does not lie inside"),
    ("list with endless name", _endless_name, "does not lie inside"),
    ("list names what is not there", _listed_but_missing, "names 'ants9', which is no folder"),
    ("empty list", _empty_list, "names no sequence"),
    ("images elsewhere", _images_elsewhere, "does not lie inside"),
    ("pattern that would fill memory", _pattern_of_percents, "nowhere: holds no images"),
    ("tag with words", _odd_tag, "occlusion.tag: holds 'yes'"),
    ("tag too long", _long_tag, "occlusion.tag: holds 4 labels for 3 frames"),
    ("label too short", _short_label, "absence.label: holds 1 labels for 3 frames"),
    ("UAV123 with another count", _uav_wrong_count, "bird1_1 goes from image 1 to 253"),
    ("UAV123 with a hole", _uav_hole, "images of 1 of them are missing, from 3 on"),
    ("UAV123 without the video", _uav_no_video, "bike1: holds no images"),
    ("two of one name", _twice_one_name, "a second sequence is called 'ants1'"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("damage", "message"), [r[1:] for r in DAMAGED], ids=[r[0] for r in DAMAGED]
)
def test_damage_is_told_in_one_line(tmp_path, damage, message):
    root = tmp_path / "data set"
    root.mkdir()
    damage(root)
    line = answer(root)
    assert re.search(message, line), line


NO_JSON = [
    ("empty", ""),
    ("cut off", '{"a": {"img_names": ["a.jpg"'),
    ("too deep", "[" * 100_000),
    ("a list", "[1, 2]"),
    ("nothing in it", "{}"),
    ("something else", '{"a": {"b": 1}}'),
    ("huge number", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 1%s]]}}' % ("0" * 400)),
    ("infinite", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, Infinity]]}}'),
    ("words", '{"a": {"img_names": ["1.jpg"], "gt_rect": [["x", 2, 3, 4]]}}'),
    ("no rows", '{"a": {"img_names": ["1.jpg"], "gt_rect": [1]}}'),
    ("counts", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4], [1, 2, 3, 4]]}}'),
    ("no boxes", '{"a": {"img_names": [], "gt_rect": []}}'),
    ("leads out", '{"a": {"img_names": ["../1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}'),
    ("name that leads out", '{"../a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}'),
    ("name of two lines", '{"a\\nb": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}'),
    (
        "name without end",
        '{"%s": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}' % ("a" * 9999),
    ),
    ("tag", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]], "occlusion": ["x"]}}'),
    ("attr", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]], "attr": 5}}'),
    (
        "tags without end",
        json.dumps(
            {"a": {"img_names": ["1"], "gt_rect": [[1] * 4], **{str(i): [] for i in range(99)}}}
        ),
    ),
    ("long tag", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]], "t": [0, 1]}}'),
]


@pytest.mark.parametrize("content", [r[1] for r in NO_JSON], ids=[r[0] for r in NO_JSON])
def test_damaged_json_is_told_in_one_line(tmp_path, content):
    path = tmp_path / "VOT2018.json"
    path.write_text(content)
    line = answer(path)
    assert "VOT2018.json" in line
    assert len(line) < 400
