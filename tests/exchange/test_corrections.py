"""Keyframes that a person has corrected are read back from the tools' files."""

import json
from dataclasses import replace
from fractions import Fraction
from xml.etree import ElementTree

import pytest

from ssiam.errors import AnnotationsError
from ssiam.exchange import (
    Annotation,
    Annotations,
    Keyframe,
    read_any_annotations,
    read_corrections,
    write_exports,
)
from ssiam.track import Track
from ssiam.video import open_results

SIZE, RATE = (200, 100), 25
KINDS = {"cvat": "xml", "labelstudio": "json"}


def tracked(count=12, targets=1, keyframes=(0,), lost=()):
    rows = tuple(
        Annotation(
            frame,
            frame / RATE,
            target,
            (10.0 + frame, 20.125 * target, 30.25, 18.5),
            lost=frame in lost,
            keyframe=frame in keyframes,
        )
        for target in range(1, targets + 1)
        for frame in range(count)
    )
    return Annotations(SIZE, RATE, tuple(f"boat {i + 1}" for i in range(targets)), rows)


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture
def exported(kind, tmp_path):
    """Export annotations; returns the file."""

    def write(annotations):
        path = tmp_path / f"clip.{KINDS[kind]}"
        write_exports(annotations, path, kind)
        return path

    return write


def corrected(path, changes):
    """Change boxes as a person does, {(target, frame): xywh or None}, in a file of either tool."""
    if path.suffix == ".xml":
        tree = ElementTree.parse(path)
        for (target, frame), xywh in changes.items():
            track = next(t for t in tree.iter("track") if t.get("id") == str(target))
            shape = next(b for b in track if b.get("frame") == str(frame))
            if xywh is None:
                shape.set("outside", "1")
                continue
            x, y, w, h = xywh
            for name, value in (("xtl", x), ("ytl", y), ("xbr", x + w), ("ybr", y + h)):
                shape.set(name, str(value))
        tree.write(path)
        return
    (task,) = json.loads(path.read_text())
    regions = task["predictions"][0]["result"]
    for (target, frame), xywh in changes.items():
        region = next(r for r in regions if r["id"] == f"target-{target}")
        sequence = region["value"]["sequence"]
        item = next(i for i in sequence if i["frame"] == frame + 1)
        if xywh is None:
            sequence.remove(item)
            next(i for i in sequence if i["frame"] == frame)["enabled"] = False
            continue
        sides = dict(zip(("x", "y", "width", "height"), xywh, strict=True))
        for name, side in zip(sides, (*SIZE, *SIZE), strict=True):
            item[name] = 100 * sides[name] / side
    path.write_text(
        json.dumps([{"data": task["data"], "annotations": [{"id": 1, "result": regions}]}])
    )


def test_a_round_trip_loses_nothing(exported, annotations):
    """Boxes, rotated boxes, absence and names; two targets."""
    path = exported(annotations)
    found = read_any_annotations(path, annotations.size_wh, annotations.fps)
    before = {(row.frame, row.target): row for row in annotations.rows if row.visible}
    after = {(row.frame, row.target): row for row in found.rows if row.visible}
    assert after.keys() == before.keys()
    for key, row in after.items():
        assert row.xywh == pytest.approx(before[key].xywh if row.corners is None else row.xywh)
        assert (row.corners is None) == (before[key].corners is None)
        if row.corners is not None:
            flat = [value for point in row.corners for value in point]
            assert flat == pytest.approx([v for p in before[key].corners for v in p], abs=2e-3)
    assert found.names == annotations.names
    gaps = {(row.frame, row.target) for row in found.rows if not row.visible}
    assert (2, 1) in gaps  # where the first target is lost


def test_only_what_differs_from_the_exported_results_is_corrected(exported):
    previous = tracked(targets=2)
    path = exported(previous)
    corrected(path, {(1, 4): (20.0, 30.0, 33.0, 11.0), (2, 7): (50.0, 40.0, 30.0, 20.0)})
    first, second = read_corrections(path, SIZE, RATE, previous)
    assert [each.frame for each in first] == [0, 4]  # the first box was given before
    assert first[1].xywh == pytest.approx((20.0, 30.0, 33.0, 11.0))
    assert [each.frame for each in second] == [0, 7]


def test_keyframes_of_the_round_before_are_kept(exported):
    previous = tracked(keyframes=(0, 5))
    path = exported(previous)
    corrected(path, {(1, 9): (20.0, 30.0, 33.0, 11.0)})
    (found,) = read_corrections(path, SIZE, RATE, previous)
    assert [each.frame for each in found] == [0, 5, 9]


def test_a_target_that_is_marked_absent(exported):
    previous = tracked()
    path = exported(previous)
    corrected(path, {(1, 6): None})
    (found,) = read_corrections(path, SIZE, RATE, previous)
    assert found == [Keyframe(0, pytest.approx(previous.rows[0].xywh)), Keyframe(6, None)]


def test_what_the_tracker_called_lost_is_no_correction(exported):
    previous = tracked(lost=(4, 5, 6))
    path = exported(previous)
    (found,) = read_corrections(path, SIZE, RATE, previous)
    assert [each.frame for each in found] == [0]


def test_without_results_every_keyframe_of_the_file_counts(tmp_path):
    """As CVAT writes a track with two keyframes: with what it interpolates between them."""
    boxes = "".join(
        f'<box frame="{frame}" keyframe="{int(frame in (3, 6))}" outside="0" occluded="0" '
        f'xtl="{frame}" ytl="10.0" xbr="{frame + 20}" ybr="30.5" z_order="0"></box>'
        for frame in range(3, 7)
    )
    (tmp_path / "c.xml").write_text(
        f'<annotations><version>1.1</version><track id="0" label="a" source="manual">{boxes}'
        "</track></annotations>"
    )
    (found,) = read_corrections(tmp_path / "c.xml", SIZE, RATE)
    assert found == [Keyframe(3, (3, 10, 20, 20.5)), Keyframe(6, (6, 10, 20, 20.5))]


def test_own_results_are_corrections_too(tmp_path):
    path = tmp_path / "r.csv"
    with open_results(path) as sink:
        for frame in range(5):
            sink.write(frame, None, [Track((frame, 2, 30, 40), keyframe=frame in (0, 3))])
    (found,) = read_corrections(path, SIZE, RATE)
    assert [each.frame for each in found] == [0, 3]


def test_label_studio_of_a_variable_frame_rate(tmp_path):
    """Frames are numbered by their times there; the exported results say which is which."""
    times = (0.0, 0.02, 0.1, 0.12, 0.3)
    plain = tracked(len(times))
    rows = tuple(replace(row, time=time) for row, time in zip(plain.rows, times, strict=True))
    previous = replace(plain, rows=rows, fps=Fraction(25))
    path = tmp_path / "clip.json"
    write_exports(previous, path, "labelstudio")
    found = read_any_annotations(path, SIZE, 25, previous)
    assert [row.frame for row in found.rows] == list(range(len(times)))


DAMAGED = [
    ("c.xml", "<annotations><track", "is not XML"),
    ("c.xml", "<annotations/>", "has no boxes"),
    ("c.xml", '<!DOCTYPE a [<!ENTITY b "c">]><annotations/>', "document type"),
    ("c.xml", "<annotations><image id='0'/></annotations>", "CVAT for video 1.1"),
    ("c.xml", "<annotations><track id='x'/></annotations>", "id of a track is 'x'"),
    ("c.xml", "<annotations><track id='0'><box frame='1'/></track></annotations>", "xtl is miss"),
    (
        "c.xml",
        "<annotations><track id='0'><mask frame='1'/></track></annotations>",
        "has the shape 'mask'",
    ),
    ("c.json", "[{", "is not JSON"),
    ("c.json", "[{}, {}]", "has 2 tasks"),
    ("c.json", "[{}]", "has no annotations"),
    ("c.json", '[{"annotations": [{"result": [{"type": "videorectangle"}]}]}]', "no sequence"),
    ("c.txt", "", "unknown kind of corrections"),
]


@pytest.mark.parametrize(("name", "content", "message"), DAMAGED)
def test_damaged_files_are_refused_in_one_line(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(AnnotationsError, match=message) as caught:
        read_corrections(tmp_path / name, SIZE, RATE)
    assert "\n" not in str(caught.value)


def test_a_target_without_a_box_is_refused(tmp_path):
    (tmp_path / "c.xml").write_text(
        "<annotations><track id='0'><box frame='1' outside='1' xtl='0' ytl='0' xbr='9' ybr='9'/>"
        "</track></annotations>"
    )
    with pytest.raises(AnnotationsError, match="target 1 has no keyframe with a box"):
        read_corrections(tmp_path / "c.xml", SIZE, RATE)


def test_more_targets_than_were_exported_are_refused(exported):
    path = exported(tracked(targets=2))
    with pytest.raises(AnnotationsError, match="has 2 targets, but the results"):
        read_corrections(path, SIZE, RATE, tracked(targets=1))
