"""Masks in results and in every format that holds them; start frame, step and names of images."""

import json
from dataclasses import replace
from xml.etree import ElementTree
from zipfile import ZipFile

import cv2
import numpy as np
import pytest

from ssiam.cli import main
from ssiam.errors import AnnotationsError, ArgumentError, SinkError
from ssiam.exchange import Annotations, read_annotations, write_exports
from ssiam.exchange.annotations import annotation_from_track
from ssiam.exchange.mask_shapes import polygon
from ssiam.track import Track
from ssiam.video import open_results
from ssiam.video.mask_codec import decode_mask, encode_mask

WIDTH, HEIGHT = SIZE = (64, 48)


def ellipse(frame):
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return ((x - 20 - frame) / 12) ** 2 + ((y - 20) / 8) ** 2 < 1


def track(frame, *, lost=False):
    return Track((8.0 + frame, 12.0, 25.0, 17.0), 0.9, lost=lost, mask=ellipse(frame))


@pytest.fixture
def annotations():
    """Six frames; the target is lost in frame 3."""
    rows = tuple(
        replace(
            annotation_from_track(f, f / 25, 1, track(f, lost=f == 3)),
            mask=encode_mask(ellipse(f)),
        )
        for f in range(6)
    )
    return Annotations(SIZE, 25, ("duck",), rows)


@pytest.fixture(params=["csv", "jsonl"])
def results(request, tmp_path):
    path = tmp_path / f"r.{request.param}"
    with open_results(path, masks=True) as sink:
        sink.write(0, 0.0, [None])
        for frame in range(1, 6):
            sink.write(frame, frame / 25, [track(frame)])
    return path


def test_results_hold_masks(results):
    rows = read_annotations(results, SIZE, 25).rows
    assert rows[0].mask is None
    for row in rows[1:]:
        assert (decode_mask(row.mask, SIZE) == ellipse(row.frame)).all()


def test_a_mask_of_another_frame_size_is_refused(results):
    with pytest.raises(AnnotationsError, match=r"mask is not that of a frame of 65x48"):
        read_annotations(results, (65, 48), 25)


def test_long_masks_are_read(tmp_path):
    noise = np.random.default_rng(0).random((HEIGHT * 4, WIDTH * 4)) < 0.5
    for name in ("r.csv", "r.jsonl"):
        with open_results(tmp_path / name, masks=True) as sink:
            sink.write(0, None, [Track((1, 2, 3, 4), mask=noise)])
        (row,) = read_annotations(tmp_path / name, (WIDTH * 4, HEIGHT * 4), 25).rows
        assert len(row.mask) > 10_000
        assert (decode_mask(row.mask, (WIDTH * 4, HEIGHT * 4)) == noise).all()


@pytest.mark.parametrize("name", ["r.txt", "r.xyz"])
def test_other_results_cannot_hold_masks(tmp_path, name):
    with pytest.raises(SinkError, match=name):
        open_results(tmp_path / name, masks=True)


def test_coco(annotations, tmp_path):
    write_exports(annotations, tmp_path / "c.json", "coco")
    for each in json.loads((tmp_path / "c.json").read_text())["annotations"]:
        frame, segmentation = each["image_id"] - 1, each["segmentation"]
        assert segmentation["size"] == [HEIGHT, WIDTH]
        assert (decode_mask(segmentation["counts"], SIZE) == ellipse(frame)).all()
        assert each["area"] == ellipse(frame).sum()


def filled(points):
    """The pixels whose centers are in a polygon whose pixel edges are whole numbers."""
    mask = np.zeros((HEIGHT * 16, WIDTH * 16), np.uint8)
    cv2.fillPoly(mask, [np.round(np.array(points) * 16).astype(np.int32)], 1)
    return mask[8::16, 8::16].astype(bool)


def overlap(mask, other):
    return (mask & other).sum() / (mask | other).sum()


def test_polygon_encloses_the_mask():
    assert overlap(filled(polygon(ellipse(0))), ellipse(0)) > 0.93


def test_polygon_of_a_rectangle_is_its_edges():
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[10:20, 5:35] = True
    assert np.ptp(polygon(mask), axis=0) == pytest.approx((30, 10), abs=0.6)
    assert np.mean(polygon(mask), axis=0) == pytest.approx((20, 15), abs=0.3)


def test_cvat_polygons(annotations, tmp_path):
    write_exports(annotations, tmp_path / "c.xml", "cvat", shape="polygon")
    (tree,) = ElementTree.parse(tmp_path / "c.xml").getroot().findall("track")
    shapes = {int(each.get("frame")): each for each in tree.findall("polygon")}
    assert [shapes[f].get("outside") for f in range(6)] == list("000100")
    for frame in (0, 4):
        pairs = [pair.split(",") for pair in shapes[frame].get("points").split(";")]
        assert overlap(filled([(float(x), float(y)) for x, y in pairs]), ellipse(frame)) > 0.93


def from_cvat(shape):
    """As cvat_sdk.masks.decode_mask: rows of the bounds, background first."""
    left, top, width, height = (int(shape.get(n)) for n in ("left", "top", "width", "height"))
    runs = [int(run) for run in shape.get("rle").split(",")]
    part = np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(height, width)
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[top : top + height, left : left + width] = part
    return mask


def test_cvat_masks_are_tracks_of_one_frame(annotations, tmp_path):
    write_exports(annotations, tmp_path / "c.xml", "cvat", shape="mask")
    tracks = ElementTree.parse(tmp_path / "c.xml").getroot().findall("track")
    assert len(tracks) == 5
    for each in tracks:
        first = each[0]
        assert (from_cvat(first) == ellipse(int(first.get("frame")))).all()
        assert [shape.get("outside") for shape in each[1:]] in (["1"], [])


def from_brush(rle):
    """As Label Studio decodes it: https://github.com/thi-ng/umbrella, package rle-pack."""
    bits = "".join(f"{byte:08b}" for byte in rle)
    position = 0

    def read(count):
        nonlocal position
        position += count
        return int(bits[position - count : position], 2)

    size, width = read(32), read(5) + 1
    lengths = [read(4) + 1 for _ in range(4)]
    found = []
    while len(found) < size:
        is_run = read(1)
        count = read(lengths[read(2)]) + 1
        found += [read(width)] * count if is_run else [read(width) for _ in range(count)]
    return np.array(found).reshape(HEIGHT, WIDTH, 4)


def test_label_studio_brush(annotations, tmp_path):
    write_exports(annotations, tmp_path / "b.json", "labelstudio-brush")
    tasks = json.loads((tmp_path / "b.json").read_text())
    assert [task["data"]["image"] for task in tasks][:2] == ["frame_000000.jpg", "frame_000001.jpg"]
    assert [len(task["predictions"][0]["result"]) for task in tasks] == [1, 1, 1, 0, 1, 1]
    (result,) = tasks[2]["predictions"][0]["result"]
    assert result["type"] == "brushlabels"
    assert result["value"]["brushlabels"] == ["duck"]
    assert (result["original_width"], result["original_height"]) == SIZE
    image = from_brush(result["value"]["rle"])
    assert ((image == 255).all(axis=2) == ellipse(2)).all()


def yolo_lines(path):
    with ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.startswith("labels/")]
        return {n: archive.read(n).decode().splitlines() for n in names}, archive.read(
            "data.yaml"
        ).decode()


def test_yolo_segmentation(annotations, tmp_path):
    write_exports(annotations, tmp_path / "y.zip", "yolo")
    labels, data = yolo_lines(tmp_path / "y.zip")
    assert list(labels) == [f"labels/frame_{f:06d}.txt" for f in range(6)]
    assert labels["labels/frame_000003.txt"] == []
    assert '  0: "duck"' in data
    (line,) = labels["labels/frame_000002.txt"]
    number, *shares = line.split()
    points = np.array(shares, float).reshape(-1, 2) * SIZE
    assert number == "0"
    assert overlap(filled(points), ellipse(2)) > 0.93


def test_yolo_detection(annotations, tmp_path):
    plain = tuple(replace(row, mask=None) for row in annotations.rows)
    cut = replace(plain[5], xywh=(50.0, 30.0, 28.0, 10.0))
    write_exports(replace(annotations, rows=(*plain[:5], cut)), tmp_path / "y.zip", "yolo")
    labels, _ = yolo_lines(tmp_path / "y.zip")
    (line,) = labels["labels/frame_000000.txt"]
    assert [float(v) for v in line.split()] == pytest.approx(
        [0, 20.5 / 64, 20.5 / 48, 25 / 64, 17 / 48], abs=1e-6
    )
    (line,) = labels["labels/frame_000005.txt"]  # cut at the frame's edge
    assert [float(v) for v in line.split()] == pytest.approx(
        [0, 57 / 64, 35 / 48, 14 / 64, 10 / 48], abs=1e-6
    )


def test_start_and_step(annotations, tmp_path):
    every = annotations.every(1, 2)
    assert [row.frame for row in every.rows] == [1, 3, 5]
    write_exports(every, tmp_path / "c.xml", "cvat")
    root = ElementTree.parse(tmp_path / "c.xml").getroot()
    task = root.find("meta/task")
    names = ("size", "start_frame", "stop_frame", "frame_filter")
    assert [task.findtext(name) for name in names] == ["3", "1", "5", "step=2"]
    boxes = [(each.get("frame"), each.get("outside")) for each in root.iter("box")]
    assert boxes == [("1", "0"), ("3", "1"), ("5", "0")]
    write_exports(every, tmp_path / "c.json", "coco")
    images = json.loads((tmp_path / "c.json").read_text())["images"]
    assert [image["file_name"][6:12] for image in images] == ["000001", "000003", "000005"]
    write_exports(every, tmp_path / "l.json", "labelstudio")
    (task,) = json.loads((tmp_path / "l.json").read_text())
    sequence = task["predictions"][0]["result"][0]["value"]["sequence"]
    assert [(item["frame"], item["enabled"]) for item in sequence] == [(2, False), (6, True)]


def test_impossible_steps_are_refused(annotations):
    with pytest.raises(ArgumentError, match="in steps of 0"):
        replace(annotations, step=0)


def test_what_needs_masks_is_refused_without(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with open_results("r.csv") as sink:
        sink.write(0, None, [Track((1, 2, 3, 4))])
    export = ["export", "r.csv", "--size", "64x48", "--fps", "25", "--out", "x", "--to"]
    for words in (["labelstudio-brush"], ["cvat", "--shape", "mask"]):
        assert main([*export, *words]) == 2
        assert "r.csv holds no masks: write them with" in capsys.readouterr().err
    assert main([*export, "coco", "--shape", "mask"]) == 2
    assert not (tmp_path / "x").exists()


def test_a_shape_is_for_cvat_alone(annotations, tmp_path):
    with pytest.raises(ArgumentError, match="omit mask for coco"):
        write_exports(annotations, tmp_path / "x", "coco", shape="mask")


def test_images_of_a_folder_keep_their_names(tmp_path, monkeypatch, capsys):
    """From tracking to COCO and YOLO, through the command line."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shots").mkdir()
    picture = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    for name in ("IMG_2.png", "IMG_10.png", "IMG_11.png"):
        cv2.imwrite(f"shots/{name}", picture)
    command = ["track", "shots", "--box", "20,10,24,24", "--results", "r.csv", "--masks"]
    assert main(command) == 0
    export = ["export", "r.csv", "--video", "shots", "--to"]
    assert main([*export, "coco", "--out", "c.json"]) == 0
    images = json.loads((tmp_path / "c.json").read_text())["images"]
    assert [image["file_name"] for image in images] == ["IMG_2.png", "IMG_10.png", "IMG_11.png"]
    assert main([*export, "yolo", "--out", "y.zip", "--start", "1"]) == 0
    assert list(yolo_lines(tmp_path / "y.zip")[0]) == ["labels/IMG_10.txt", "labels/IMG_11.txt"]
    assert "1 targets in 2 frames" in capsys.readouterr().out


def test_masks_need_results_that_hold_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["track", "a.mp4", "--box", "1,2,3,4", "--out", "o.mp4", "--masks"]) == 2
    assert "give --results" in capsys.readouterr().err
    assert main(["track", "a.mp4", "--box", "1,2,3,4", "--results", "r.txt", "--masks"]) == 2
    assert "r.txt: cannot hold masks" in capsys.readouterr().err
