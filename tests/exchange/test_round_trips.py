"""Random targets, as displayed frame by frame by the programs that read an export."""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ssiam.exchange import Annotation, Annotations, write_exports
from ssiam.exchange.annotations import rotated_box

WIDTH, HEIGHT, FRAMES, TARGETS = 320, 240, 12, 3

pixels = st.floats(-50, 400).map(lambda value: round(value, 3) + 0.0)
sides = st.floats(0, 300).map(lambda value: round(value, 3))
details = st.tuples(st.tuples(pixels, pixels, sides, sides), st.booleans())
rows = st.dictionaries(
    st.tuples(st.integers(0, FRAMES - 1), st.integers(1, TARGETS)), details, max_size=20
)
names = st.lists(st.text(max_size=8), min_size=TARGETS, max_size=TARGETS).map(tuple)


@st.composite
def any_annotations(draw):
    found = tuple(
        Annotation(frame, None, target, xywh, None, 0.5, lost)
        for (frame, target), (xywh, lost) in draw(rows).items()
    )
    length = draw(st.integers(0, FRAMES + 3))
    return Annotations((WIDTH, HEIGHT), 30, draw(names), found, length)


def displayed_by_cvat(path, length):
    """As in CVAT: a box is displayed until the next keyframe, unless it is outside."""
    displayed = {}
    for track in ElementTree.parse(path).getroot().iter("track"):
        boxes = {int(box.get("frame")): box for box in track}
        assert list(boxes) == sorted(boxes)
        assert max(boxes) < length
        assert {box.get("keyframe") for box in track} == {"1"}
        current = None
        for frame in range(length):
            current = boxes.get(frame, current)
            if current is not None and current.get("outside") == "0":
                left, top, right, bottom = (
                    float(current.get(n)) for n in ("xtl", "ytl", "xbr", "ybr")
                )
                displayed[frame, int(track.get("id"))] = (left, top, right - left, bottom - top)
    return displayed


def displayed_by_label_studio(path, length):
    """As in its player: the last keyframe counts; one not enabled counts on its own frame only."""
    displayed = {}
    (task,) = json.loads(path.read_text())
    for result in task["predictions"][0]["result"]:
        sequence = result["value"]["sequence"]
        assert result["value"]["framesCount"] == length
        for frame in range(length):
            before = [each for each in sequence if each["frame"] <= frame + 1]
            if before and (before[-1]["enabled"] or before[-1]["frame"] == frame + 1):
                x, y, w, h = (before[-1][name] / 100 for name in ("x", "y", "width", "height"))
                number = int(result["id"].removeprefix("target-"))
                displayed[frame, number] = (x * WIDTH, y * HEIGHT, w * WIDTH, h * HEIGHT)
    return displayed


def displayed_by_coco(path, length):
    content = json.loads(path.read_text())
    images = {image["id"]: image["file_name"] for image in content["images"]}
    assert list(images.values()) == [f"frame_{frame:06d}.jpg" for frame in range(length)]
    known = {category["id"] for category in content["categories"]}
    assert {each["category_id"] for each in content["annotations"]} <= known
    return {
        (int(images[each["image_id"]][6:12]), each["track_id"]): each["bbox"]
        for each in content["annotations"]
    }


def displayed_by_got10k(path, length, numbers):
    displayed = {}
    with ZipFile(path) as archive:
        folders = archive.read("list.txt").decode().splitlines()
        assert len({folder.casefold() for folder in folders}) == len(folders)
        files = [name for name in archive.namelist() if name != "list.txt"]
        assert {name.split("/")[0] for name in files} == set(folders)
        assert len(files) == 5 * len(folders)
        for folder, number in zip(folders, numbers, strict=True):
            truth = archive.read(f"{folder}/groundtruth.txt").decode().splitlines()
            absent = archive.read(f"{folder}/absence.label").decode().splitlines()
            assert len(truth) == len(absent) == length
            boxes = [tuple(map(float, line.split(","))) for line in truth]
            for frame, (box, flag) in enumerate(zip(boxes, absent, strict=True)):
                if flag == "0":
                    displayed[frame, number] = box
    return displayed


@settings(max_examples=60, deadline=None)
@given(any_annotations())
def test_targets_are_displayed_exactly_where_visible(annotations):
    expected = {(row.frame, row.target): row.xywh for row in annotations.rows if row.visible}
    length = annotations.frame_count
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "export"
        for kind, read in (
            ("cvat", displayed_by_cvat),
            ("labelstudio", displayed_by_label_studio),
            ("coco", displayed_by_coco),
            ("got10k", lambda path, n: displayed_by_got10k(path, n, annotations.tracks())),
        ):
            write_exports(annotations, path, kind)
            displayed = read(path, length)
            assert displayed.keys() == expected.keys(), kind
            for key, box in displayed.items():
                assert box == pytest.approx(expected[key], abs=0.0011), kind


@given(
    st.tuples(st.floats(-500, 500), st.floats(-500, 500)),
    st.tuples(st.floats(1, 300), st.floats(1, 300)),
    st.floats(-400, 400),
    st.integers(0, 3),
    st.booleans(),
)
def test_rotated_box_has_the_original_corners(center, size, degrees, start, reverse):
    corners = rotated_corners(center, size, degrees)
    ordered = np.roll(corners[::-1] if reverse else corners, start, axis=0)
    box = rotated_box(Annotation(0, None, 1, (0, 0, 1, 1), tuple(map(tuple, ordered.tolist()))))
    assert abs(box.degrees) <= 45 + 1e-6
    again = rotated_corners((box.cx, box.cy), (box.w, box.h), box.degrees)
    distances = np.linalg.norm(again[:, None] - corners, axis=2)
    assert distances.min(axis=1).max() < 1e-6
    assert sorted(distances.argmin(axis=1)) == [0, 1, 2, 3]
    assert again[0] == pytest.approx(box.rotated_xy, abs=1e-9)


def rotated_corners(center, size, degrees):
    """Corners of a box rotated clockwise on screen, starting with the original top left one."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    half = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * np.array(size) / 2
    return half @ np.array([[cos, sin], [-sin, cos]]) + center
