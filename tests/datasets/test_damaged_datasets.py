"""Damaged datasets: each gives an error of one line with the file."""

from __future__ import annotations

import json
import re

import pytest

from helpers.dataset_errors import error_line
from helpers.datasets_on_disk import (
    boxes,
    write_got10k,
    write_lasot,
    write_otb,
    write_uav123,
    write_vot,
)


def _no_dataset(root):
    (root / "a").mkdir()
    (root / "notes.md").write_text("x")


def _missing_image(root):
    (write_vot(root, "ants1") / "00000003.jpg").unlink()


def _missing_box(root):
    write_otb(root, "Walking", range(1, 5), boxes(3))


def _no_images(root):
    for path in write_lasot(root, "cat-1").rglob("*.jpg"):
        path.unlink()


def _truncated_david(root):
    write_otb(root, "David", range(300, 310), boxes(471))


def _polygons_in_otb(root):
    write_otb(root, "Walking", range(1, 4), [[1] * 8] * 3)


def _list_leads_out(root):
    write_vot(root.parent, "secret")
    (root / "list.txt").write_text("../secret\n")


def _list_is_absolute(root):
    (root / "list.txt").write_text(f"{root}\n")


def _long_name(root):
    (root / "list.txt").write_text("x" * 5000)


def _listed_but_missing(root):
    write_vot(root, "ants1")
    (root / "list.txt").write_text("ants1\nants9\n")


def _empty_list(root):
    (root / "list.txt").write_text("\n")


def _images_outside(root):
    folder = write_vot(root, "ants1", toolkit=True)
    (folder / "sequence").write_text("channels.color=../../%08d.jpg\n")


def _wide_pattern(root):
    folder = write_vot(root, "ants1", toolkit=True)
    (folder / "sequence").write_text("channels.color=nowhere/%999999999d.jpg\n")


def _tag_of_words(root):
    write_vot(root, "ants1", tags={"occlusion.tag": ("0", "yes", "1")})


def _long_tag(root):
    write_vot(root, "ants1", tags={"occlusion.tag": (0, 1, 1, 0)})


def _short_label(root):
    (write_got10k(root, "val", 1) / "absence.label").write_text("0\n")


def _uav_wrong_count(root):
    write_uav123(root, "bird1_1", "bird1", range(1, 300), boxes(250))


def _uav_missing_image(root):
    write_uav123(root, "bike1", "bike1", (1, 2, 4, 5), boxes(5))


def _uav_no_video(root):
    write_uav123(root, "bike1", "bike2", (1, 2), boxes(2))


def _duplicate_name(root):
    write_vot(root / "a", "ants1")
    write_vot(root / "b", "ants1")


DAMAGED = [
    ("no dataset", _no_dataset, "expected a folder of sequences .*; found 1 .md, 1 folder \\(a\\)"),
    ("empty folder", lambda root: None, "found an empty folder"),
    ("missing image", _missing_image, "ants1: 2 images but 3 boxes"),
    ("missing box", _missing_box, "Walking: 4 images but 3 boxes"),
    ("no images", _no_images, "img: has no images"),
    ("part of the images with all boxes", _truncated_david, "David: 10 images but 471 boxes"),
    ("polygons in OTB", _polygons_in_otb, "has polygons"),
    ("list leads out", _list_leads_out, "'../secret' is not inside"),
    ("list with absolute path", _list_is_absolute, "is not inside"),
    ("list with long name", _long_name, "is not inside"),
    ("missing folder in list", _listed_but_missing, "names 'ants9', but there is no such folder"),
    ("empty list", _empty_list, "names no sequence"),
    ("images outside", _images_outside, "is not inside"),
    ("pattern that would fill memory", _wide_pattern, "nowhere: has no images"),
    ("tag with words", _tag_of_words, "occlusion.tag: has 'yes'"),
    ("tag too long", _long_tag, "occlusion.tag: has 4 labels for 3 frames"),
    ("label too short", _short_label, "absence.label: has 1 labels for 3 frames"),
    ("UAV123 with wrong count", _uav_wrong_count, "bird1_1 goes from image 1 to 253"),
    ("UAV123 without an image", _uav_missing_image, "images of 1 of them are missing, from 3 on"),
    ("UAV123 without the video", _uav_no_video, "bike1: has no images"),
    ("duplicate name", _duplicate_name, "a second sequence is called 'ants1'"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("damage", "message"), [r[1:] for r in DAMAGED], ids=[r[0] for r in DAMAGED]
)
def test_damage_is_an_error_of_one_line(tmp_path, damage, message):
    root = tmp_path / "data set"
    root.mkdir()
    damage(root)
    line = error_line(root)
    assert re.search(message, line), line


DAMAGED_JSON = [
    ("empty", ""),
    ("truncated", '{"a": {"img_names": ["a.jpg"'),
    ("deeply nested", "[" * 100_000),
    ("a list", "[1, 2]"),
    ("empty object", "{}"),
    ("other keys", '{"a": {"b": 1}}'),
    ("huge number", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 1%s]]}}' % ("0" * 400)),
    ("infinite", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, Infinity]]}}'),
    ("words", '{"a": {"img_names": ["1.jpg"], "gt_rect": [["x", 2, 3, 4]]}}'),
    ("rows are numbers", '{"a": {"img_names": ["1.jpg"], "gt_rect": [1]}}'),
    (
        "more boxes than images",
        '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4], [1, 2, 3, 4]]}}',
    ),
    ("no boxes", '{"a": {"img_names": [], "gt_rect": []}}'),
    ("image outside", '{"a": {"img_names": ["../1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}'),
    ("name with a folder", '{"../a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}'),
    ("name with a line break", '{"a\\nb": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}'),
    (
        "long name",
        '{"%s": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]]}}' % ("a" * 9999),
    ),
    ("tag", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]], "occlusion": ["x"]}}'),
    ("attr", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]], "attr": 5}}'),
    (
        "many tags",
        json.dumps(
            {"a": {"img_names": ["1"], "gt_rect": [[1] * 4], **{str(i): [] for i in range(99)}}}
        ),
    ),
    ("long tag", '{"a": {"img_names": ["1.jpg"], "gt_rect": [[1, 2, 3, 4]], "t": [0, 1]}}'),
]


@pytest.mark.parametrize("content", [r[1] for r in DAMAGED_JSON], ids=[r[0] for r in DAMAGED_JSON])
def test_damaged_json_is_an_error_of_one_line(tmp_path, content):
    path = tmp_path / "VOT2018.json"
    path.write_text(content)
    line = error_line(path)
    assert "VOT2018.json" in line
    assert len(line) < 400
